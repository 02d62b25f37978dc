// lightloom list and workers: the jobs and the workers of a service.

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/progress.h"
#include "client/service_options.h"
#include "client/text_table.h"
#include "server/status_json.h"

namespace lightloom::client {
namespace {

std::string resolution_text(const JobInfo& job) {
    const Rect& crop = job.spec.frame.crop;
    const int width = crop.empty() ? job.spec.width : crop.width(), height = crop.empty() ? job.spec.height : crop.height();
    return width > 0 ? std::to_string(width) + "x" + std::to_string(height) : "-";  // the scene's, which nobody has read yet
}

/// "12/64 spp 18 %", or without the total for a job with a time limit.
std::string progress_text(const JobInfo& job) {
    std::string text = std::to_string(job.samples_per_pixel_done);
    if (job.spec.samples_per_pixel > 0) text.append("/").append(std::to_string(job.spec.samples_per_pixel));
    return text + " spp " + std::to_string(int(100 * rendered_share(job))) + " %";
}

std::string note(const JobInfo& job) {
    if (!job.message.empty()) return job.message;
    std::string text = job.state == JobState::kPreparing ? phase_text(job) : "";
    if (!is_terminal(job.state) && job.eta_seconds >= 0)
        text += (text.empty() ? "ETA " : ", ETA ") + duration_text(job.eta_seconds);
    return text;
}

/// Workers that have been gone for longer are shown on demand only: a coordinator never forgets one.
constexpr double kGoneSeconds = 3600;

std::string work_text(const WorkerStatus& worker) {
    // A heartbeat that came between two units names none; before the first unit, the worker fetches and builds the scene.
    if (!worker.in_work && worker.state == WorkerState::kBusy) return worker.units_merged > 0 ? "between units" : "reads a scene";
    if (!worker.in_work) return "-";
    return worker.in_work->job_id + " unit " + unit_name(worker.in_work->key);
}

/// "1.25 M/s"
std::string rate_text(double samples_per_second) {
    if (!(samples_per_second > 0)) return "-";
    char text[32];
    std::snprintf(text, sizeof text, "%.3g M/s", samples_per_second * 1e-6);
    return text;
}

int print_lines(const auto& items) {
    for (const auto& item : items) std::printf("%s\n", status_text(status_json(item)).c_str());
    return kSuccess;
}

}  // namespace

int list_jobs(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto jobs = port.list_jobs();
    if (!jobs.ok()) return service_error(options, jobs.status());
    if (options.json) return print_lines(*jobs);
    std::vector<std::vector<std::string>> rows{
        {"JOB", "NAME", "OWNER", "SCENE", "ALGORITHM", "SIZE", "PROGRESS", "STATE", "AGE", "NOTE"}};
    for (const JobInfo& job : *jobs) {
        rows.push_back({cell(job.job_id, 32), cell(job.label.name, 24), cell(job.label.owner, 28), path_cell(job.scene, 28),
                        cell(job.algorithm, 16), resolution_text(job), progress_text(job), std::string(to_string(job.state)),
                        age_text(job.age_seconds), note(job).empty() ? "" : cell(note(job), 2000)});
    }
    std::fputs(text_table(rows).c_str(), stdout);
    return kSuccess;
}

int list_workers(const ServiceOptions& options) {
    GrpcJobPort port = connect(options);
    const auto workers = port.list_workers(options.all ? 0 : kGoneSeconds);
    if (!workers.ok()) return service_error(options, workers.status());
    if (options.json) return print_lines(*workers);
    std::vector<std::vector<std::string>> rows{
        {"WORKER", "HOST", "THREADS", "STATE", "IN WORK", "MERGED", "SAMPLES", "LAST HEARD", "NOTE"}};
    for (const WorkerStatus& worker : *workers) {
        rows.push_back({cell(worker.worker_id, 48), cell(worker.host, 28), std::to_string(worker.thread_count),
                        std::string(to_string(worker.state)), cell(work_text(worker), 48), std::to_string(worker.units_merged),
                        rate_text(worker.samples_per_second), age_text(worker.seconds_since_heard) + " ago",
                        worker.note.empty() ? "" : cell(worker.note, 2000)});
    }
    std::fputs(text_table(rows).c_str(), stdout);
    return kSuccess;
}

}  // namespace lightloom::client
