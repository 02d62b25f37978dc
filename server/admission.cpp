#include "server/admission.h"

#include <cmath>
#include <new>
#include <random>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "common/path/path_view.h"
#include "server/prepare_job.h"
#include "server/results.h"

namespace lightloom {
namespace {

/// Ids must be unique, also across restarts of the coordinator.
std::string new_id(const char* prefix) {
    std::random_device device;
    const uint64_t bits = (uint64_t(device()) << 32) ^ device();
    char text[48];
    std::snprintf(text, sizeof text, "%s-%012llx", prefix, static_cast<unsigned long long>(bits >> 16));
    return text;
}

Status no_job(const std::string& id) {
    return not_found("no job has the id '" + id +
                     "'; a name is only a label: `lightloom list` shows the ids of those that exist (the oldest that ended are "
                     "forgotten)");
}

Status going_down() { return {StatusCode::kUnavailable, "the coordinator is going down"}; }

}  // namespace

Result<JobSpec> canonical_spec(const JobSpec& spec) {
    JobSpec out = spec;
    out.frame = {};
    out.algorithm = spec.algorithm.completed();
    if (spec.samples_per_pixel > 0 && spec.time_limit_seconds > 0)
        return invalid_argument("a job has a number of samples per pixel or a time limit, not both");
    if (spec.samples_per_pixel == 0 && spec.time_limit_seconds == 0 && spec.noise_target == 0)
        return invalid_argument("a job needs a number of samples per pixel, a time limit or a noise target");
    if (spec.noise_target != 0 && !(spec.noise_target >= JobSpec::kMinNoiseTarget && spec.noise_target <= JobSpec::kMaxNoiseTarget))
        return invalid_argument("the noise target is a relMSE between 1e-9 and 1");
    if (spec.noise_target > 0 && spec.samples_per_pixel > 0 && spec.samples_per_pixel < NoiseEstimate::kLeastGroups)
        return invalid_argument("a noise target needs " + std::to_string(NoiseEstimate::kLeastGroups) +
                                " samples per pixel at least, from as many groups of which the noise is estimated");
    if (spec.samples_per_pixel > JobSpec::kMaxSamplesPerPixel)
        return invalid_argument("at most " + std::to_string(JobSpec::kMaxSamplesPerPixel) + " samples per pixel");
    LL_RETURN_IF_ERROR(check_time_limit(spec.time_limit_seconds));
    if (spec.max_depth < -1 || spec.max_depth >= kMaxEdges)
        return invalid_argument("max depth must lie between 0 and " + std::to_string(kMaxEdges - 1));
    if (spec.width < 0 || spec.height < 0 || spec.width > kMaxFrameSide || spec.height > kMaxFrameSide ||
        (spec.width == 0) != (spec.height == 0))
        return invalid_argument("a resolution needs a width and a height between 1 and " + std::to_string(kMaxFrameSide));
    return out;
}

Result<std::string> Admission::check_assets(const JobSpec& spec) const {
    const AssetStore& assets = office_.assets;
    const Digest& root = spec.scene_root;
    if (!office_.options.read_scene) return internal_error("this coordinator has no scene reader");
    if (!assets.contains(root)) return failed_precondition("the scene's file list " + root.hex() + " was not uploaded");
    const auto text = assets.read(root);
    if (!text.ok()) return text.status();
    const auto manifest = AssetManifest::parse(*text);
    if (!manifest.ok()) return manifest.status();
    for (const AssetEntry& entry : manifest->entries) {
        if (office_.options.scene_files_needed && !assets.contains(entry.digest))
            return failed_precondition("\"" + entry.path + "\" of the scene was not uploaded");
    }
    return manifest->main;
}

std::optional<Result<JobInfo>> Admission::repeated(JobBook& book, const std::string& request_id, const JobSpec& spec) const {
    const JobPtr known = book.find_request(request_id);
    if (!known) return std::nullopt;
    if (same_request(known->job.submission().submitted, spec)) return Result<JobInfo>(book.info(*known, office_.now()));
    return Result<JobInfo>(Status(StatusCode::kAlreadyExists, "request " + request_id + " was used for another job; use a new id"));
}

Result<JobInfo> Admission::submit(const std::string& request_id, const JobSpec& spec, const JobLabel& label) {
    if (request_id.empty() || request_id.size() > 128) return invalid_argument("a request id has 1 to 128 characters");
    LL_RETURN_IF_ERROR(check_label(label));
    const MutexLock one_at_a_time(submit_mutex_);
    {
        const OpenBook book(office_);
        if (auto answer = repeated(*book, request_id, spec)) return *answer;
        if (book->closing) return going_down();
        if (book->open_jobs().size() >= office_.options.max_jobs)
            return Status(StatusCode::kResourceExhausted,
                          "the coordinator has no room for more jobs; submit again when some have ended");
    }
    auto canonical = canonical_spec(spec);
    if (!canonical.ok()) return canonical.status();
    auto scene = check_assets(spec);
    if (!scene.ok()) return scene.status();
    const std::string id = new_id("job");
    Job::Submission submission{.id = id,
                               .request_id = request_id,
                               .submitted = spec,
                               .label = label,
                               .scene = *std::move(scene),
                               .created_at = utc_now(),
                               .directory = office_.options.directory / "jobs" / id};
    LL_RETURN_IF_ERROR(office_.archive.accept(submission, office_.options.identity));
    crash_point("server.job-kept");

    OpenBook book(office_);
    const JobPtr file = book->add(Job(std::move(submission), *std::move(canonical), office_.now()));
    book.note().info(id + ": accepted, " + std::string(spec.algorithm.name()) + " " + spec.scene_root.hex().substr(0, 12));
    crash_point("server.job-accepted");
    start_preparing(office_, book, file);
    return book->info(*file, office_.now());
}

Result<JobInfo> Admission::cancel(const std::string& job_id) {
    OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    if (file->job.ended()) return book->info(*file, office_.now());
    book.apply(file, file->job.end(JobState::kCancelled, {}, office_.now()));
    const JobInfo info = book->info(*file, office_.now());
    book.close();
    // That it ended is told to the archive when the book is closed; it is said here once more, to know that it is on disk.
    const Status kept = office_.archive.end(info);
    if (!kept.ok())
        return Status(StatusCode::kUnavailable, "job " + job_id + " is cancelled, but that could not be written down (" +
                                                    kept.message() + "): after a restart it would go on; cancel it again");
    return info;
}

Result<JobInfo> Admission::get(const std::string& job_id) const {
    const OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    return file ? Result<JobInfo>(book->info(*file, office_.now())) : no_job(job_id);
}

std::vector<JobInfo> Admission::list() const {
    const OpenBook book(office_);
    std::vector<JobInfo> out;
    for (const auto& [number, file] : book->jobs()) out.push_back(book->info(*file, office_.now()));
    return out;
}

Result<JobInfo> Admission::wait(const std::string& job_id, uint64_t after, double timeout_seconds) const {
    const auto end = seconds_after(std::chrono::steady_clock::now(), timeout_seconds);
    OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    while (!book->closing && file->job.revision() <= after && std::chrono::steady_clock::now() < end)
        book.wait_until(file->changed, end);
    if (book->closing) return going_down();
    return book->info(*file, office_.now());
}

Status Admission::wait_end(const std::string& job_id, double timeout_seconds) const {
    const auto end = seconds_after(std::chrono::steady_clock::now(), timeout_seconds);
    OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    while (!book->closing && !file->job.ended() && std::chrono::steady_clock::now() < end) book.wait_until(file->changed, end);
    return {};
}

Result<std::filesystem::path> Admission::finished_directory(const std::string& job_id, const char* what) const {
    const OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    if (file->job.state() != JobState::kSucceeded)
        return failed_precondition("job " + job_id + " is " + std::string(to_string(file->job.state())) + "; its " + what +
                                   " exists once it has succeeded");
    return file->job.submission().directory;
}

Result<std::string> Admission::image(const std::string& job_id, ImageKind kind) const {
    if (kind == ImageKind::kPreview) {
        auto made = preview(job_id, PreviewFormat::kPng, 0);
        if (!made.ok()) return made.status();
        return std::move(made->bytes);
    }
    const auto directory = finished_directory(job_id, "image");
    return directory.ok() ? read_image(*directory) : directory.status();
}

Result<std::string> Admission::manifest(const std::string& job_id) const {
    const auto directory = finished_directory(job_id, "manifest");
    return directory.ok() ? read_file((*directory / "manifest.json").string()) : directory.status();
}

Result<Preview> Admission::preview(const std::string& job_id, PreviewFormat format, double exposure) const {
    const MutexLock one_at_a_time(preview_mutex_);
    std::shared_ptr<Reducer> reducer;
    JobPtr file;
    JobSpec spec;
    {
        const OpenBook book(office_);
        file = book->find(job_id);
        if (!file) return no_job(job_id);
        const Job& job = file->job;
        const std::string what = "job " + job_id + " is " + std::string(to_string(job.state()));
        if (job.state() == JobState::kPreparing)
            return failed_precondition(what + " (" + phase_text(book->info(*file, office_.now())) + "): there is no image yet");
        if (!job.reducer() && job.state() != JobState::kSucceeded)
            return failed_precondition(what + ": what was rendered of it is gone");
        reducer = job.reducer();
        spec = job.spec();
    }
    try {
        auto made = make_preview(spec, file->job.submission().directory, reducer.get(), format, exposure);
        if (made.ok()) return made;
        return Status(made.status().code(), "job " + job_id + ": " + made.status().message());
    } catch (const std::bad_alloc&) {  // it must not end the coordinator
        return Status(StatusCode::kResourceExhausted, "the coordinator has too little memory for a preview of job " + job_id);
    }
}

}  // namespace lightloom
