#include "server/finish_job.h"

#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "server/results.h"

namespace lightloom {
namespace {

/// The counts of the finished image, in the job and in its manifest.
std::optional<Manifest> settle_counts(Office& office, const JobPtr& file, const Job::Image& image) {
    const OpenBook book(office);
    Job& job = file->job;
    if (job.state() != JobState::kFinishing) return std::nullopt;  // it was cancelled meanwhile
    Manifest manifest;
    manifest.units = job.settle(image);
    manifest.job = job.info(office.now());
    manifest.identity = office.options.identity;
    manifest.created_at = job.submission().created_at;
    manifest.finished_at = utc_now();
    manifest.groups = job.merged_groups();
    manifest.iterations = job.merged_iterations();
    for (const uint32_t index : job.workers()) {
        const WorkerRecord& w = book->workers.at(index);
        manifest.workers.push_back({index, w.id, w.hello.host, w.hello.process_id, w.hello.thread_count});
    }
    manifest.dropped = job.reducer()->first_dropped();
    manifest.expired_leases = job.incidents.expired_leases;
    manifest.rejected_results = job.incidents.rejected;
    return manifest;
}

Status write_results(Office& office, const JobPtr& file) {
    std::shared_ptr<Reducer> reducer;
    JobSpec spec;
    std::vector<ImageLayer> layers;
    {
        const OpenBook book(office);
        if (file->job.state() != JobState::kFinishing) return {};
        reducer = file->job.reducer();
        layers = file->job.take_layers();
        spec = file->job.spec();
    }
    reducer->freeze();
    auto developed = reducer->developed(true);
    if (!developed.ok()) return developed.status();
    Job::Image counts;
    counts.noise = reducer->final_noise();
    counts.rare_light = reducer->rare_light_report(mean_luminance(developed->color));
    const auto image = encode_image(spec, *std::move(developed), std::move(layers));
    if (!image.ok()) return image.status();
    counts.digest = sha256(*image);
    counts.size = image->size();
    auto manifest = settle_counts(office, file, counts);
    if (!manifest) return {};
    if (const auto text = office.assets.read(spec.scene_root); text.ok()) {
        if (const auto list = AssetManifest::parse(*text); list.ok())
            manifest->scene_main = list->main, manifest->without = list->without;
    }
    const std::filesystem::path& directory = file->job.submission().directory;
    std::error_code error;
    std::filesystem::create_directories(directory, error);  // if that fails, so does writing, which says why
    crash_point("server.image-encoded");
    const auto write = [&](const char* name, const std::string& bytes) {
        return with_room(office, file, [&] { return write_file_atomically((directory / name).string(), bytes); });
    };
    LL_RETURN_IF_ERROR(write("image.exr", *image));
    crash_point("server.image-written");
    LL_RETURN_IF_ERROR(write("manifest.json", to_json(*manifest)));
    LL_RETURN_IF_ERROR(flush_folder(directory.parent_path().string()));
    crash_point("server.manifest-written");

    OpenBook book(office);
    if (file->job.state() == JobState::kFinishing) book.apply(file, file->job.end(JobState::kSucceeded, {}, office.now()));
    crash_point("server.job-ended");
    return {};
}

}  // namespace

void finish_if_complete(Office& office, OpenBook& book, const JobPtr& file) {
    bool finish = false;
    book.apply(file, file->job.finish_if_complete(office.now(), &finish));
    if (finish) book.start(file, "to write the image of this job", [&office, file] { return write_results(office, file); });
}

}  // namespace lightloom
