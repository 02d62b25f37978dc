// The commands that talk to a service: submit and watch; the others have files of their own.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/job_label.h"
#include "client/local_scene.h"
#include "client/run_job.h"
#include "client/service_options.h"
#include "common/cli/numbers.h"
#include "common/core/utf8.h"
#include "server/status_json.h"

namespace lightloom::client {
namespace {

/// How often a job is submitted, if the service loses files of its scene.
constexpr int kJobAttempts = 3;

constexpr const char* kSubmitFooter = R"(Examples:
  lightloom submit room.pbrt --server render1:50051 -o out.exr --png out.png --spp 256
  lightloom submit room.pbrt --server render1:50051 --detach          prints the job's id and returns
  lightloom fetch JOB --server render1:50051 -o out.exr               later

The job's id is printed to standard error at once, unless --quiet: `watch`, `preview` and `cancel` take it from elsewhere.
Files that the service has already are not sent again. Ctrl-C cancels the job, unless it is one that somebody else has submitted.
A job that was rendered before, or is under way, is not rendered twice: its image is the answer. Those with --time are.)";

/// What answers the submission, if that is an earlier job.
void tell_of_reuse(const JobInfo& job) {
    std::fprintf(stderr, "lightloom: the same job %s: %s; --again renders anew\n",
                 job.state == JobState::kSucceeded ? "was rendered before" : "is under way", job.job_id.c_str());
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
    const JobLabel label = make_label(options.name, options.job.scene);
    for (int attempt = 1;; ++attempt) {
        const Reuse reuse = options.again ? Reuse::kAnew : Reuse::kAllowed;
        const auto job = submit_scene(port, local->scene, local->spec, label, times, reuse);
        if (!job.ok()) return service_error(options, job.status());
        if (job->reused && !options.job.quiet) tell_of_reuse(*job);
        if (options.detach) {
            std::printf("%s\n", job->job_id.c_str());
            return kSuccess;
        }
        if (!options.job.quiet) std::fprintf(stderr, "lightloom: %s\n", job->job_id.c_str());
        const auto begin = std::chrono::steady_clock::now();
        const auto ended = watch(port, job->job_id, options.job.quiet, !job->reused);
        times.wait_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        if (ended.ok()) return fetch(port, *ended, options.job, times, AfterFetch::kImageStays);
        if (job->reused && ended.status().code() == StatusCode::kCancelled && !interrupt_token().stop_requested() &&
            attempt < kJobAttempts) {
            std::fprintf(stderr, "lightloom: %s by somebody else; it is submitted again\n",
                         one_line(ended.status().message()).c_str());
            continue;
        }
        // A job that failed because the service lost files of the scene is worth another attempt, with these files.
        const bool failed = ended.status().code() == StatusCode::kAborted;
        if (!failed || attempt == kJobAttempts || !lacks_files(port, local->scene)) return job_error(options, ended.status());
        std::fprintf(stderr, "lightloom: %s; it is submitted again, with the files that are missing\n",
                     one_line(ended.status().message()).c_str());
    }
}

int watch_job(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto print = [](const JobInfo& job) {
        std::printf("%s\n", status_text(status_json(job)).c_str());
        std::fflush(stdout);  // who reads a pipe wants it now
    };
    const auto ended = watch(port, options.job_id, options.job.quiet || options.json, false,
                             options.json ? print : std::function<void(const JobInfo&)>());
    return ended.ok() ? kSuccess : job_error(options, ended.status());
}

constexpr const char* kWatchFooter =
    R"(--json prints the present state first and the final one last, ten a second at most. Null stands for what is not known (yet).
Exit codes: 0 the job succeeded, 1 it failed or the service does not know it, 130 it was cancelled.)";

constexpr const char* kFetchFooter =
    R"(--partial writes an EXR of whole groups of iterations without first-hit layers; its header says how many samples a pixel has. A
job that has ended has a manifest, too. A failed job keeps its groups, a cancelled one with `cancel --keep`.)";

constexpr const char* kFinishFooter =
    R"(The job ends with the group of iterations that is completed next, at least one, and succeeds: `fetch` writes its image, and the
manifest says how many samples it has. A job that still prepares has nothing to finish with, and one that has ended stays as it is.)";

constexpr const char* kListFooter =
    "OWNER is USER@HOST as the submitter claimed, which nobody has checked. AGE counts from the submission.";

constexpr const char* kWorkersFooter =
    R"(States: busy (it holds a unit), idle (it waits for one), resting (it failed several in a row and gets none for a while), gone
(it left, or was not heard of for longer than a lease), refused (it was not let in; NOTE says why).
SAMPLES are camera samples per second in its latest units, or light paths of an algorithm that only splats.)";

constexpr const char* kPreviewFooter =
    R"(The image has the samples that are merged: whole groups of iterations, never parts of one. An EXR has the bytes that
`lightloom render --spp N` writes for as many samples without --layers. Exit code 1 before the first group is complete.)";

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
        command
            ->add_option("--name", options->name,
                         "What `list` calls the job, up to 128 bytes (default: the scene file's name without .pbrt)")
            ->check([](const std::string& name) {
                return check_label({name, {}}).message();
            });
        const auto detach = command->add_flag("--detach", options->detach,
                                              "Print the job's id and return at once; `fetch --strict` tells of dropped samples");
        command->add_flag("--again", options->again, "Render it even if the same job was rendered before");
        for (const char* later : {"--output", "--half", "--png", "--json"})  // `fetch` has its own
            detach->excludes(command->get_option(later));
    }
    {
        const auto [command, options] = add("watch", "Show a job's progress until it ends", watch_job);
        add_job_argument(*command, *options);
        command->footer(kWatchFooter);
        command->add_flag("-q,--quiet", options->job.quiet, "Wait without a word");
        command->add_flag("--json", options->json, "One JSON object per change and line instead, as of /api/v1/status");
    }
    {
        const auto [command, options] =
            add("fetch", "Write the image and manifest of a finished job, or what there is of another", fetch_job);
        add_job_argument(*command, *options);
        command->footer(kFetchFooter);
        command->add_option("-o,--output", options->job.output, "EXR to write (default: JOB.exr, or JOB-partial.exr)");
        add_image_settings(*command, options->job);
        command->add_option("--json", options->job.json, "Write statistics to this file");
        command->add_flag("-q,--quiet", options->job.quiet, "Errors only");
        command->add_flag("--strict", options->job.strict, "Exit with 3 if samples were dropped");
        const auto partial = command->add_flag("--partial", options->partial,
                                               "What there is of a job that runs, failed or was cancelled: its complete groups");
        for (const char* whole : {"--half", "--json", "--strict"}) partial->excludes(command->get_option(whole));
    }
    {
        const auto [command, options] = add("cancel", "Cancel a job", cancel_job);
        add_job_argument(*command, *options);
        command->add_flag("--keep", options->keep, "Keep its complete groups for `fetch --partial` instead of throwing them away");
    }
    {
        const auto [command, options] = add("finish", "End a job well, with the samples that it has", finish_job);
        add_job_argument(*command, *options);
        command->footer(kFinishFooter);
    }
    {
        const auto [command, options] = add("list", "List the jobs of a service", list_jobs);
        command->footer(kListFooter);
        command->add_flag("--json", options->json, "One JSON object per job and line, as of /api/v1/status");
    }
    {
        const auto [command, options] = add("workers", "List the workers of a service", list_workers);
        command->footer(kWorkersFooter);
        command->add_flag("--all", options->all, "Also those that have been gone for more than an hour");
        command->add_flag("--json", options->json, "One JSON object per worker and line, as of /api/v1/status");
    }
    {
        const auto [command, options] = add("preview", "Write the image of a running job as it is now", preview_job);
        command->footer(kPreviewFooter);
        add_job_argument(*command, *options);
        command->add_option("-o,--output", options->job.output,
                            "FILE.png, or FILE.exr with the colours and the variance (default: JOB-preview.png)");
        command->add_option("--exposure", options->job.exposure, "Stops by which a PNG is brightened")
            ->check(number_between(-30.0, 30.0));
        command->add_flag("-q,--quiet", options->job.quiet, "Errors only");
    }
}

}  // namespace lightloom::client
