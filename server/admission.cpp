#include "server/admission.h"

#include <cmath>
#include <random>
#include <system_error>

#include "common/core/crash_point.h"
#include "common/path/path_view.h"
#include "common/transport/parameters.h"
#include "common/work/job_fields.h"
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

std::optional<Digest> reuse_key(const JobSpec& spec) {
    if (spec.time_limit_seconds > 0) return std::nullopt;
    // Where the size of the training set is not chosen it depends on the number of samples, which a chosen one of that size does
    // not.
    const bool chosen_size = spec.algorithm.chosen(kTrainingPaths);
    return sha256("lightloom-request 1\n" + fields_text<job_role::kRequest>(spec) + (chosen_size ? "training set chosen\n" : ""));
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

std::optional<JobInfo> Admission::same_job(const Digest& key) const {
    JobPtr file;
    JobInfo info;
    {
        OpenBook book(office_);
        file = book->find_same(key);
        if (!file) return std::nullopt;
        info = book->info(*file, office_.now());
        info.reused = true;
        if (!file->job.ended()) {
            book.note().info(info.job_id + ": is the answer to another submission of the same spec");
            return info;
        }
    }
    const std::filesystem::path& directory = file->job.submission().directory;
    std::error_code error;
    const uint64_t size = std::filesystem::file_size(directory / kImageFiles.image, error);
    const bool sound = !error && size == info.image_size_bytes && std::filesystem::exists(directory / kImageFiles.manifest, error);
    OpenBook book(office_);
    if (!sound) {
        book->withdraw(*file);
        return std::nullopt;
    }
    book.note().info(info.job_id + ": its image is the answer to another submission of the same spec");
    return info;
}

Result<JobInfo> Admission::submit(const std::string& request_id, const JobSpec& spec, const JobLabel& label, Reuse reuse) {
    if (request_id.empty() || request_id.size() > 128) return invalid_argument("a request id has 1 to 128 characters");
    LL_RETURN_IF_ERROR(check_label(label));
    const MutexLock one_at_a_time(submit_mutex_);
    {
        const OpenBook book(office_);
        if (auto answer = repeated(*book, request_id, spec)) return *answer;
        if (book->closing) return closing_status();
        if (book->open_jobs().size() >= office_.options.max_jobs)
            return Status(StatusCode::kResourceExhausted,
                          "the coordinator has no room for more jobs; submit again when some have ended");
    }
    auto canonical = canonical_spec(spec);
    if (!canonical.ok()) return canonical.status();
    const auto key = reuse_key(spec);
    if (reuse == Reuse::kAllowed && key) {
        if (auto known = same_job(*key)) return *std::move(known);
    }
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
    const JobPtr file = book->add(Job(std::move(submission), *std::move(canonical), office_.now()), key);
    book.note().info(id + ": accepted, " + std::string(spec.algorithm.name()) + " " + spec.scene_root.hex().substr(0, 12));
    crash_point("server.job-accepted");
    start_preparing(office_, book, file);
    return book->info(*file, office_.now());
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
    if (book->closing) return closing_status();
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

}  // namespace lightloom
