#include "server/finish_job.h"

#include <system_error>

#include "common/core/atomic_file.h"

namespace lightloom {

Result<FinishedImage> finished_image(const Reducer& reducer, const JobSpec& spec, std::vector<ImageLayer> layers) {
    auto developed = reducer.developed(true);
    if (!developed.ok()) return developed.status();
    FinishedImage out;
    out.about.noise = reducer.final_noise();
    out.about.rare_light = reducer.rare_light_report(mean_luminance(developed->color));
    auto image = encode_image(spec, *std::move(developed), std::move(layers));
    if (!image.ok()) return image.status();
    out.bytes = *std::move(image);
    out.about.digest = sha256(out.bytes);
    out.about.size = out.bytes.size();
    return out;
}

Manifest settled_manifest(Office& office, const OpenBook& book, const JobPtr& file, const Job::Image& about) {
    Job& job = file->job;
    Manifest manifest;
    manifest.units = job.settle(about);
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

Status write_image(Office& office, const JobPtr& file, const std::string& image, Manifest manifest, const ImageFileNames& names,
                   crash::Label image_written, WaitsUntil until) {
    if (const auto text = office.assets.read(manifest.job.spec.scene_root); text.ok()) {
        if (const auto list = AssetManifest::parse(*text); list.ok())
            manifest.scene_main = list->main, manifest.without = list->without;
    }
    const std::filesystem::path& directory = file->job.submission().directory;
    std::error_code error;
    std::filesystem::create_directories(directory, error);  // if that fails, so does writing, which says why
    const auto write = [&](const char* name, const std::string& bytes) {
        return with_room(
            office, file, [&] { return write_file_atomically((directory / name).string(), bytes); }, until);
    };
    LL_RETURN_IF_ERROR(write(names.image, image));
    crash_point(image_written);
    LL_RETURN_IF_ERROR(write(names.manifest, to_json(manifest)));
    return flush_folder(directory.parent_path().string());
}

namespace {

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
    const auto finished = finished_image(*reducer, spec, std::move(layers));
    if (!finished.ok()) return finished.status();
    Manifest manifest;
    {
        const OpenBook book(office);
        if (file->job.state() != JobState::kFinishing) return {};  // it was cancelled meanwhile
        manifest = settled_manifest(office, book, file, finished->about);
    }
    // With a time limit nothing else says how many groups the image has, and a restart would render on.
    if (spec.time_limit_seconds > 0)
        LL_RETURN_IF_ERROR(with_room(office, file, [&] { return office.archive.finish(file->job.id(), manifest.groups); }));
    crash_point("server.image-encoded");
    LL_RETURN_IF_ERROR(
        write_image(office, file, finished->bytes, std::move(manifest), kImageFiles, "server.image-written", WaitsUntil::kJobEnds));
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
