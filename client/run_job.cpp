#include "client/run_job.h"

#include <chrono>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <thread>

#include "client/commands.h"
#include "client/output_files.h"
#include "client/progress.h"
#include "common/cli/start.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"
#include "common/transport/photon_memory.h"
#include "server/results.h"

namespace lightloom::client {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr const char* kManifest = ".manifest.json";
/// How often the files of a scene are sent, if the service loses them.
constexpr int kSendAttempts = 3;
/// Where halves cannot hold a rendered image.
constexpr const char *kFloatInstead = ".float.exr", *kFloatManifest = ".float.manifest.json";

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

std::string random_id() {
    std::random_device device;
    char text[64];
    std::snprintf(text, sizeof text, "%08x%08x%08x%08x", device(), device(), device(), device());
    return text;
}

Status write_statistics(const std::string& path, const JobInfo& job, const Digest& digest, const ClientTimes& times) {
    const double seconds = job.render_seconds > 0 ? job.render_seconds : 1e-9;
    Json json = {{"job", job.job_id},
                 {"algorithm", job.algorithm},
                 {"state", to_string(job.state)},
                 {"sha256", digest.hex()},
                 {"samples_per_pixel", job.samples_per_pixel_done},
                 {"width", job.spec.frame.crop.width()},
                 {"height", job.spec.frame.crop.height()},
                 {"seconds",
                  {{"import", times.import_seconds},
                   {"digest", times.digest_seconds},
                   {"upload", times.upload_seconds},
                   {"prepare", job.prepare_seconds},
                   {"render", job.render_seconds},
                   {"finish", job.finish_seconds},
                   {"submit_to_end", times.wait_seconds},
                   {"fetch", times.fetch_seconds}}},
                 {"samples", job.camera_samples},
                 {"samples_per_second", double(job.camera_samples) / seconds},
                 {"light_paths", job.light_paths},
                 {"rays", job.rays},
                 {"rays_per_second", double(job.rays) / seconds},
                 {"units", job.unit_done},
                 {"workers", job.worker_count},
                 {"dropped_samples", job.dropped_samples},
                 {"duplicates_same", job.duplicates_same},
                 {"duplicates_different", job.duplicates_different}};
    if (job.rare_light != RareLightReport{}) json["rare_light"] = to_json(job.rare_light);
    if (job.noise) json["noise"] = to_json(job.noise, job.spec.noise_target);
    // Of workers in this process alone; those of a service have theirs.
    if (const PhotonMemory photons = most_photon_memory(); job.spec.algorithm.merges() && photons.total() > 0)
        json["photon_memory_bytes"] = {{"light_paths", photons.paths}, {"map", photons.map}};
    if (job.tables.asset.size_bytes > 0) json["tables"] = to_json(job.tables);
    return write_file_atomically(path, json.dump(1) + "\n");
}

void report_dropped(const JobInfo& job, const std::string& manifest) {
    std::fprintf(stderr, "lightloom: %llu non-finite sample(s) were dropped; render the first of them again with:\n",
                 static_cast<unsigned long long>(job.dropped_samples));
    const Json json = Json::parse(manifest, nullptr, false);
    if (json.is_discarded() || !json.contains("dropped")) return;
    std::set<std::string> commands;  // one unit may have dropped several splats
    for (const Json& sample : json["dropped"]["first"]) {
        const std::string command = sample.value("replay", std::string());
        if (commands.insert(command).second) std::fprintf(stderr, "  %s\n", command.c_str());
    }
}

/// What the image does not show of its own error.
void warn_of_rare_light(const JobInfo& job) {
    const RareLightReport& rare = job.rare_light;
    if (rare.mean_error > RareLightReport::kNotableError) {
        std::fprintf(
            stderr,
            "lightloom: warning: about %.0f %% of the light comes through glass or mirrors to where only a chance hit of a "
            "lamp finds it; %.2g sample(s) of this job can be expected to have done so. The image may be too dark or "
            "spotted (standard error of its mean %.0f %%); larger lamps or more samples help\n",
            100 * rare.share, rare.expected_hits, 100 * rare.mean_error);
    }
    if (rare.unreachable_share > RareLightReport::kNotableShare) {
        std::fprintf(
            stderr,
            "lightloom: warning: about %.0f %% of the light comes through glass or mirrors from lights that cannot be hit, "
            "and `%s` cannot find it; a small sphere in place of a point light can be hit\n",
            100 * rare.unreachable_share, job.algorithm.c_str());
    }
}

/// Why a job with a noise target ended above it.
void tell_of_missed_target(const JobInfo& job) {
    if (!(job.spec.noise_target > 0) || (job.noise && job.noise->reached)) return;
    std::string why = "its noise is known from " + std::to_string(NoiseEstimate::kLeastGroups) + " groups of iterations on";
    if (job.noise && job.noise->light_missing) {
        why = "light that only chance finds may be missing from the image";
    } else if (job.noise && job.noise->estimate.groups >= NoiseEstimate::kLeastGroups) {
        why = noise_text(*job.noise);
    }
    std::fprintf(stderr, "lightloom: the job ended before --noise %.3g was reached: %s\n", job.spec.noise_target, why.c_str());
}

/// An image as it is written: the EXR, its manifest, and the EXR's digest, which the manifest names.
struct ImageFiles {
    std::string exr, manifest;
    Digest digest;
};

/// The same image with half colours.
Result<ImageFiles> as_half(const ImageFiles& files, const std::string& name) {
    const auto image = decode_exr(files.exr, name);
    if (!image.ok()) return image.status();
    auto exr = encode_exr(*image, ExrPixelType::kHalf);
    if (!exr.ok()) return exr.status();
    Json json = Json::parse(files.manifest, nullptr, false);
    if (json.is_discarded() || !json["image"].is_object()) return data_loss("the manifest that arrived is damaged; fetch it again");
    const Digest digest = sha256(*exr);
    json["image"]["sha256"] = digest.hex();
    json["image"]["size_bytes"] = exr->size();
    json["image"]["colour"] = "half";
    json["image"]["float_sha256"] = files.digest.hex();
    return ImageFiles{*std::move(exr), json.dump(1) + "\n", digest};
}

}  // namespace

std::stop_token interrupt_token() {
    static std::stop_source source;
    static const bool installed = [] {
        // The thread that waits outlives main, so it has a share of its own in the state that the static's destructor lets go.
        StopSignals().on_stop([stop = source]() mutable { stop.request_stop(); }, kCancelled);
        return true;
    }();
    (void)installed;
    return source.get_token();
}

std::vector<const char*> beside_image(const JobOptions& options, AfterFetch after) {
    if (options.half && after == AfterFetch::kImageGoes) return {kManifest, kFloatInstead, kFloatManifest};
    return {kManifest};
}

Status check_outputs(const JobOptions& options, const std::vector<const char*>& beside, const LocalScene* scene) {
    const std::filesystem::path output = output_path(options);
    std::error_code unknown;
    if (std::filesystem::is_other(std::filesystem::status(output, unknown)))
        return invalid_argument(output.string() + ": is a device or a pipe, beside which no manifest can lie; give a file name");
    for (const char* picture : {".png", ".jpg", ".jpeg"})
        if (output.extension() == picture)
            return invalid_argument(output.string() + ": the image is an EXR; name it so, and a picture with --png");
    std::vector<std::string> outputs{output.string()};
    for (const char* extension : beside) outputs.push_back(std::filesystem::path(output).replace_extension(extension).string());
    outputs.insert(outputs.end(), {options.png, options.json});
    return check_output_files(scene ? files_of(*scene) : std::vector<std::filesystem::path>(), outputs);
}

namespace {

/// The files of a scene, and their list; of those with the same bytes, one.
std::vector<Digest> digests_of(const LocalScene& scene) {
    std::set<Digest> digests{scene.manifest.root()};
    for (const AssetEntry& entry : scene.manifest.entries) digests.insert(entry.digest);
    return {digests.begin(), digests.end()};
}

}  // namespace

Status upload_scene(JobPort& port, const LocalScene& scene) {
    const std::string text = scene.manifest.canonical_text();
    const Digest root = sha256(text);
    std::map<Digest, const AssetEntry*> entries;
    for (const AssetEntry& entry : scene.manifest.entries) entries.emplace(entry.digest, &entry);
    const auto missing = port.find_missing(digests_of(scene));
    if (!missing.ok()) return missing.status();
    for (const Digest& digest : *missing) {
        if (interrupt_token().stop_requested()) return {StatusCode::kCancelled, "interrupted"};
        if (digest == root) {
            LL_RETURN_IF_ERROR(port.upload_bytes(root, text));
            continue;
        }
        const auto entry = entries.find(digest);
        if (entry != entries.end()) LL_RETURN_IF_ERROR(port.upload(digest, scene.directory / entry->second->path));
    }
    return {};
}

Result<JobInfo> submit(JobPort& port, const JobSpec& spec, const JobLabel& label, Reuse reuse) {
    // One id for all attempts: a submission whose answer was lost is not made twice.
    const std::string request_id = random_id();
    for (int attempt = 0;; ++attempt) {
        auto job = port.submit_job(request_id, spec, label, reuse);
        const StatusCode code = job.status().code();
        const bool lost = code == StatusCode::kUnavailable || code == StatusCode::kDeadlineExceeded;
        if (job.ok() || !lost || attempt == 3) return job;
        std::this_thread::sleep_for(std::chrono::milliseconds(200 << attempt));
    }
}

bool lacks_files(JobPort& port, const LocalScene& scene) {
    const auto missing = port.find_missing(digests_of(scene));
    return missing.ok() && !missing->empty();
}

Result<JobInfo> submit_scene(JobPort& port, const LocalScene& scene, const JobSpec& spec, const JobLabel& label, ClientTimes& times,
                             Reuse reuse) {
    for (int attempt = 1;; ++attempt) {
        const auto begin = Clock::now();
        LL_RETURN_IF_ERROR(upload_scene(port, scene));
        times.upload_seconds += seconds_since(begin);
        auto job = submit(port, spec, label, reuse);
        // A file may have turned out to be damaged in the service's store, or may have been collected meanwhile.
        const StatusCode code = job.status().code();
        const bool files = code == StatusCode::kDataLoss || code == StatusCode::kFailedPrecondition;
        if (!files || attempt == kSendAttempts || !lacks_files(port, scene)) return job;
    }
}

int report_job_error(const Status& status) {
    const int code = report_error(status);
    return status.code() == StatusCode::kNotFound ? kFailure : code;
}

Result<JobInfo> watch(JobPort& port, const std::string& job_id, bool quiet, bool cancel_on_interrupt,
                      const std::function<void(const JobInfo&)>& on_change) {
    Progress progress(quiet);
    const Status status = port.watch_job(
        job_id,
        [&](const JobInfo& job) {
            progress.show(job);
            if (on_change) on_change(job);
        },
        interrupt_token());
    progress.finish();
    if (status.code() == StatusCode::kCancelled) {
        if (cancel_on_interrupt) {
            const auto cancelled = port.cancel_job(job_id);
            if (!cancelled.ok() || cancelled->state == JobState::kSucceeded) return cancelled;  // it had just ended
            if (cancelled->state == JobState::kFailed)
                return Status(StatusCode::kAborted, "job " + job_id + " failed: " + cancelled->message);
        }
        return Status(StatusCode::kCancelled, "interrupted; job " + job_id + (cancel_on_interrupt ? " was cancelled" : " goes on"));
    }
    if (!status.ok()) return status;
    auto job = port.get_job(job_id);
    if (!job.ok()) return job.status();
    if (job->state == JobState::kFailed) return Status(StatusCode::kAborted, "job " + job_id + " failed: " + job->message);
    if (job->state == JobState::kCancelled) return Status(StatusCode::kCancelled, "job " + job_id + " was cancelled");
    return job;
}

int fetch(JobPort& port, const JobInfo& job, const JobOptions& options, ClientTimes times, AfterFetch after) {
    const auto begin = Clock::now();
    auto image = port.image(job.job_id, ImageKind::kFinal);
    if (!image.ok()) return report_job_error(image.status());
    if (sha256(*image) != job.image_digest)
        return report_error(data_loss("the image that arrived differs from the one that was written; fetch it again"));
    auto manifest = port.manifest(job.job_id);
    if (!manifest.ok()) return report_job_error(manifest.status());
    ImageFiles files{*std::move(image), *std::move(manifest), job.image_digest};
    std::filesystem::path output = output_path(options);
    Status half_refused;
    if (options.half) {
        if (auto halves = as_half(files, output.string()); halves.ok()) {
            files = *std::move(halves);
        } else if (after == AfterFetch::kImageStays) {
            return report_error(failed_precondition(halves.status().message() + "; nothing is lost: `lightloom fetch " +
                                                    job.job_id + "` without --half writes it as float"));
        } else {
            output.replace_extension(kFloatInstead);
            half_refused = failed_precondition(halves.status().message() + "; so that nothing is lost it was written as float to " +
                                               output.string());
        }
    }
    const std::filesystem::path manifest_path = std::filesystem::path(output).replace_extension(kManifest);
    Status status = write_file_atomically(output.string(), files.exr);
    if (status.ok()) status = write_file_atomically(manifest_path.string(), files.manifest);
    if (status.ok() && !options.png.empty()) {
        const auto decoded = decode_exr(files.exr, output.string());
        status = decoded.ok() ? write_png(options.png, decoded->color, options.exposure) : decoded.status();
    }
    times.fetch_seconds = seconds_since(begin);
    if (status.ok() && !options.json.empty()) status = write_statistics(options.json, job, files.digest, times);
    if (status.ok()) status = half_refused;
    if (!status.ok()) return report_error(status);
    if (!options.quiet) {
        std::printf("%s  %llu spp in %s  sha256 %s\n", output.string().c_str(),
                    static_cast<unsigned long long>(job.samples_per_pixel_done), duration_text(job.render_seconds).c_str(),
                    files.digest.hex().c_str());
        if (!options.png.empty()) std::printf("%s\n", options.png.c_str());
    }
    if (!options.quiet) tell_of_missed_target(job);
    if (!options.quiet) warn_of_rare_light(job);
    if (job.dropped_samples > 0) {
        report_dropped(job, files.manifest);
        if (options.strict) return kDroppedSamples;
    }
    return kSuccess;
}

}  // namespace lightloom::client
