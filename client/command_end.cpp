// lightloom cancel and finish: jobs are ended early.

#include <cstdio>

#include "client/commands.h"
#include "client/service_options.h"
#include "common/core/utf8.h"

namespace lightloom::client {

int cancel_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto job = port.cancel_job(options.job_id, options.keep ? OnCancel::kKeep : OnCancel::kThrowAway);
    if (!job.ok()) return job_error(options, job.status());
    std::printf("%s is %s%s\n", job->job_id.c_str(), std::string(to_string(job->state)).c_str(),
                job->message.empty() ? "" : (": " + one_line(job->message)).c_str());
    return kSuccess;
}

int finish_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto job = port.finish_job(options.job_id);
    if (!job.ok()) return job_error(options, job.status());
    const bool more = job->state == JobState::kRunning;
    std::printf("%s %s %llu sample(s) per pixel\n", job->job_id.c_str(),
                more ? "ends with the group of iterations that is completed next; it has" : "ends with",
                static_cast<unsigned long long>(job->samples_per_pixel_done));
    return kSuccess;
}

}  // namespace lightloom::client
