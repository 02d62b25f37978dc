// lightloom submit, watch, fetch, cancel, list: the commands that talk to a service.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "client/commands.h"
#include "client/grpc_job_port.h"
#include "client/local_scene.h"
#include "client/progress.h"
#include "client/run_job.h"
#include "common/work/channel.h"

namespace lightloom::client {
namespace {

constexpr const char* kSubmitFooter = R"(Examples:
  lightloom submit room.pbrt --server render1:50051 -o out.exr --png out.png --spp 256
  lightloom submit room.pbrt --server render1:50051 --detach          prints the job's id and returns
  lightloom fetch JOB --server render1:50051 -o out.exr               later

Files that the service has already are not sent again. Ctrl-C cancels the job.)";

struct ServiceOptions {
    std::string server = "127.0.0.1:50051";
    JobOptions job;
    std::string job_id;
    bool detach = false;
};

void add_server_option(cli::App command, ServiceOptions& options) {
    command.add_option("--server", options.server, "HOST:PORT of the coordinator")
        ->envname("LIGHTLOOM_SERVER")
        ->capture_default_str();
}

GrpcJobPort connect(const ServiceOptions& options) {
    (void)interrupt_token();  // before gRPC makes threads
    return GrpcJobPort(open_channel(options.server), {.stop = interrupt_token()});
}

int service_error(const ServiceOptions& options, const Status& status) {
    if (status.code() != StatusCode::kUnavailable && status.code() != StatusCode::kDeadlineExceeded) return report_error(status);
    return report_error(
        {status.code(), "no answer from " + options.server + " (" + status.message() + "); is lightloom-server running there?"});
}

int submit_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto local = read_job(options.job, [&](const LocalScene& scene) {
        if (options.detach) return Status();
        return check_outputs(options.job, beside_image(options.job, AfterFetch::kImageStays), &scene);
    });
    if (!local.ok()) return report_error(local.status());
    if (Status s = check_bound(options.job, local->spec); !s.ok()) return report_error(s);
    ClientTimes times{.import_seconds = local->scene.import_seconds, .digest_seconds = local->scene.digest_seconds};
    auto begin = std::chrono::steady_clock::now();
    if (Status s = upload_scene(port, local->scene); !s.ok()) return service_error(options, s);
    times.upload_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    begin = std::chrono::steady_clock::now();
    const auto job = submit(port, local->spec);
    if (!job.ok()) return service_error(options, job.status());
    if (options.detach) {
        std::printf("%s\n", job->job_id.c_str());
        return kSuccess;
    }
    const auto ended = watch(port, job->job_id, options.job.quiet, true);
    times.wait_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (!ended.ok()) return service_error(options, ended.status());
    return fetch(port, *ended, options.job, times, AfterFetch::kImageStays);
}

int list_jobs(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto jobs = port.list_jobs();
    if (!jobs.ok()) return service_error(options, jobs.status());
    std::printf("%-18s %-10s %-8s %14s %8s  %s\n", "JOB", "STATE", "ALGO", "UNITS", "SPP", "ETA OR MESSAGE");
    for (const JobInfo& job : *jobs) {
        const std::string total = job.unit_total > 0 ? std::to_string(job.unit_total) : "-";
        const std::string units = std::to_string(job.unit_done) + "/" + total;
        std::string note = job.message;
        if (job.state == JobState::kPreparing) note = phase_text(job) + " ";
        if (job.message.empty() && !is_terminal(job.state) && job.eta_seconds >= 0) note += duration_text(job.eta_seconds);
        std::printf("%-18s %-10s %-8s %14s %8llu  %s\n", job.job_id.c_str(), std::string(to_string(job.state)).c_str(),
                    job.algorithm.c_str(), units.c_str(), static_cast<unsigned long long>(job.samples_per_pixel_done),
                    note.c_str());
    }
    return kSuccess;
}

int watch_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto ended = watch(port, options.job_id, options.job.quiet, false);
    return ended.ok() ? kSuccess : service_error(options, ended.status());
}

int fetch_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto job = port.get_job(options.job_id);
    if (!job.ok()) return service_error(options, job.status());
    JobOptions output = options.job;
    if (output.output.empty()) output.output = options.job_id + ".exr";
    if (job->state != JobState::kSucceeded) {
        const std::string what = "job " + options.job_id + " is " + std::string(to_string(job->state)) +
                                 (job->message.empty() ? "" : ": " + job->message);
        if (job->state == JobState::kCancelled) return report_error({StatusCode::kCancelled, what});
        const bool over = is_terminal(job->state);
        return report_error(failed_precondition(over ? what : what + "; `lightloom watch " + options.job_id + "` waits for it"));
    }
    if (Status s = check_outputs(output, beside_image(output, AfterFetch::kImageStays), nullptr); !s.ok()) return report_error(s);
    return fetch(port, *job, output, {}, AfterFetch::kImageStays);
}

int cancel_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto job = port.cancel_job(options.job_id);
    if (!job.ok()) return service_error(options, job.status());
    std::printf("%s is %s\n", job->job_id.c_str(), std::string(to_string(job->state)).c_str());
    return kSuccess;
}

}  // namespace

void add_service_commands(cli::App app, int* exit_code) {
    const auto add = [&](const char* name, const char* help, int (*run)(const ServiceOptions&)) {
        auto options = std::make_shared<ServiceOptions>();
        const cli::App command = app.add_subcommand(name, help);
        add_server_option(*command, *options);
        command->callback([options, exit_code, run] { *exit_code = run(*options); });
        return std::pair(command, options);
    };
    {
        const auto [command, options] = add("submit", "Render a scene with a service; waits and writes the image", submit_job);
        command->footer(kSubmitFooter);
        add_render_settings(*command, options->job);
        add_output_settings(*command, options->job);
        const auto detach = command->add_flag("--detach", options->detach,
                                              "Print the job's id and return at once; `fetch --strict` tells of dropped samples");
        for (const char* later : {"--output", "--half", "--png", "--json"})  // `fetch` has its own
            detach->excludes(command->get_option(later));
    }
    {
        const auto [command, options] = add("watch", "Show a job's progress until it ends", watch_job);
        command->add_option("JOB", options->job_id, "Id from `submit --detach` or `list`")->required();
        command->add_flag("-q,--quiet", options->job.quiet, "Wait without a word");
    }
    {
        const auto [command, options] = add("fetch", "Write the image and manifest of a finished job", fetch_job);
        command->add_option("JOB", options->job_id, "Id from `submit --detach` or `list`")->required();
        command->add_option("-o,--output", options->job.output, "EXR to write (default: JOB.exr)");
        add_image_settings(*command, options->job);
        command->add_option("--json", options->job.json, "Write statistics to this file");
        command->add_flag("-q,--quiet", options->job.quiet, "Errors only");
        command->add_flag("--strict", options->job.strict, "Exit with 3 if samples were dropped");
    }
    {
        const auto [command, options] = add("cancel", "Cancel a job", cancel_job);
        command->add_option("JOB", options->job_id, "Id from `submit --detach` or `list`")->required();
    }
    add("list", "List the jobs of a service", list_jobs);
}

}  // namespace lightloom::client
