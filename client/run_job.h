#pragma once
// From a port to a picture: upload, submit, watch, fetch, write. The same for the embedded service and for a remote one.

#include <functional>
#include <stop_token>
#include <vector>

#include "client/job_options.h"

namespace lightloom::client {

/// Requested by SIGINT or SIGTERM; a second one ends the process at once. The first call must come before other threads are made.
std::stop_token interrupt_token();

/// Seconds that the client measures itself.
struct ClientTimes {
    double import_seconds = 0, digest_seconds = 0, upload_seconds = 0, wait_seconds = 0, fetch_seconds = 0;
};

/// Whether the image can be fetched again: not from a service that ends with this process.
enum class AfterFetch { kImageStays, kImageGoes };
/// What replaces the image's extension in the names of the other files that fetch() may write.
std::vector<const char*> beside_image(const JobOptions& options, AfterFetch after);
/// check_output_files() for the files that options ask for, with those of the scene as inputs, if there is one. `beside` replaces
/// the image's extension in the names of those that come with it.
Status check_outputs(const JobOptions& options, const std::vector<const char*>& beside, const LocalScene* scene);
/// Sends what the coordinator lacks of the scene's files.
Status upload_scene(JobPort& port, const LocalScene& scene);
/// Whether the coordinator lacks any of them.
bool lacks_files(JobPort& port, const LocalScene& scene);
/// Sends what the coordinator lacks, and submits; again where it turns out to have lost files. Adds to `times`.
Result<JobInfo> submit_scene(JobPort& port, const LocalScene& scene, const JobSpec& spec, const JobLabel& label, ClientTimes& times,
                             Reuse reuse = Reuse::kAnew);
/// Submits under a fresh request id.
Result<JobInfo> submit(JobPort& port, const JobSpec& spec, const JobLabel& label = {}, Reuse reuse = Reuse::kAnew);
/// Watches until the end, and calls `on_change` with every state that it sees, the last one included; on an interrupt, cancels the
/// job if `cancel_on_interrupt` is set.
Result<JobInfo> watch(JobPort& port, const std::string& job_id, bool quiet, bool cancel_on_interrupt,
                      const std::function<void(const JobInfo&)>& on_change = {});
/// Reports the error of a call about a job, as report_error(). A job that the service does not know is a failure (1) and no mistake
/// in the command line (2), because the service may have known it before.
int report_job_error(const Status& status);
/// Fetches image and manifest of a succeeded job and writes them as options ask; reports dropped samples. Where --half is
/// refused, an image that would be lost is written as float beside OUTPUT. The exit code.
int fetch(JobPort& port, const JobInfo& job, const JobOptions& options, ClientTimes times, AfterFetch after);

}  // namespace lightloom::client
