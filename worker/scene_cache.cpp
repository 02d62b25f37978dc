#include "worker/scene_cache.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <random>
#include <thread>

#include "common/import/import.h"
#include "common/transport/training.h"

namespace lightloom {
namespace {

constexpr size_t kMaxScenes = 2;
constexpr size_t kMaxRenderers = 4;
/// The list of a scene's files; far above any real scene's.
constexpr uint64_t kMaxManifestBytes = uint64_t(64) << 20;

/// A process id alone is not enough: containers that share the cache may all run as process 1.
std::string scratch_name() {
    std::random_device device;
    return "scenes-" + std::to_string(::getpid()) + "-" + std::to_string(device());
}

}  // namespace

SceneFetcher::SceneFetcher(WorkerPort& port, std::filesystem::path directory)
    : port_(port), scratch_(directory / scratch_name()), store_(directory / "assets") {}

SceneFetcher::~SceneFetcher() {
    std::error_code ignored;
    std::filesystem::remove_all(scratch_, ignored);
}

Status SceneFetcher::fetch(const Digest& digest, uint64_t size_bytes, std::stop_token stop) {
    while (!store_.contains(digest)) {
        if (stop.stop_requested()) return {StatusCode::kCancelled, "stopped"};
        auto upload = store_.begin_upload(digest, size_bytes);
        if (!upload.ok() && upload.status().code() == StatusCode::kAborted) {
            // Another worker of this host fetches the same file into the same directory.
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
            continue;
        }
        if (!upload.ok()) return upload.status();
        LL_RETURN_IF_ERROR(port_.read_asset(digest, upload->offset(), [&](std::string_view bytes) -> Status {
            if (stop.stop_requested()) return {StatusCode::kCancelled, "stopped"};
            return upload->append(bytes);
        }));
        LL_RETURN_IF_ERROR(upload->finish());
    }
    return {};
}

Result<std::shared_ptr<const Scene>> SceneFetcher::scene(const JobSpec& spec, std::stop_token stop) {
    const Digest& root = spec.scene_root;
    if (!store_.contains(root)) {
        std::string text;
        LL_RETURN_IF_ERROR(port_.read_asset(root, 0, [&](std::string_view bytes) -> Status {
            if (text.size() + bytes.size() > kMaxManifestBytes)
                return {StatusCode::kResourceExhausted, "the scene's file list is too long"};
            text += bytes;
            return {};
        }));
        const Status status = store_.put(root, text);
        if (!status.ok() && status.code() != StatusCode::kAborted) return status;
        while (!store_.contains(root) && !stop.stop_requested())
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    const auto text = store_.read(root);
    if (!text.ok()) return text.status();
    const auto manifest = AssetManifest::parse(*text);
    if (!manifest.ok()) return manifest.status();
    for (const AssetEntry& entry : manifest->entries) LL_RETURN_IF_ERROR(fetch(entry.digest, entry.size_bytes, stop));

    const std::filesystem::path directory = scratch_ / root.hex();
    LL_RETURN_IF_ERROR(store_.materialise(*manifest, directory));
    auto imported = import_pbrt((directory / manifest->main).string());
    std::error_code ignored;
    std::filesystem::remove_all(directory, ignored);
    if (!imported.ok()) return imported.status();
    auto scene = Scene::build(std::move(imported->description), {.width = spec.width, .height = spec.height});
    if (!scene.ok()) return scene.status();
    spdlog::info("scene {} built", root.hex().substr(0, 12));
    return std::shared_ptr<const Scene>(std::move(scene).value());
}

Result<std::shared_ptr<const Renderer>> RendererCache::renderer(const JobSpec& spec, std::stop_token stop) {
    const Digest image = spec.image_digest();
    const std::lock_guard lock(mutex_);
    for (auto item = renderer_entries_.begin(); item != renderer_entries_.end(); ++item) {
        if (item->image != image) continue;
        renderer_entries_.splice(renderer_entries_.begin(), renderer_entries_, item);
        return item->renderer;
    }
    std::shared_ptr<const Scene> scene;
    for (auto item = scene_entries_.begin(); item != scene_entries_.end(); ++item) {
        if (item->root != spec.scene_root || item->width != spec.width || item->height != spec.height) continue;
        scene_entries_.splice(scene_entries_.begin(), scene_entries_, item);
        scene = item->scene;
        break;
    }
    if (!scene) {
        auto built = scenes_(spec, stop);
        if (!built.ok()) return built.status();
        scene = *std::move(built);
        scene_entries_.push_front({spec.scene_root, spec.width, spec.height, scene});
        if (scene_entries_.size() > kMaxScenes) scene_entries_.pop_back();
    }
    if (scene->frame() != spec.frame)
        return failed_precondition("this worker reads another frame from the scene than the coordinator did");
    auto renderer = create_with_tables(scene, {.algorithm = spec.algorithm,
                                             .parameters = spec.parameters,
                                             .seed = spec.seed,
                                             .max_depth = spec.max_depth},
                                       stop);
    if (!renderer.ok()) return renderer.status();
    std::shared_ptr<const Renderer> shared = std::move(renderer).value();
    renderer_entries_.push_front({image, shared});
    if (renderer_entries_.size() > kMaxRenderers) renderer_entries_.pop_back();
    return shared;
}

}  // namespace lightloom
