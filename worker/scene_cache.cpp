#include "worker/scene_cache.h"

#include <unistd.h>

#include <random>
#include <thread>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "common/import/import.h"
#include "common/transport/training.h"

namespace lightloom {
namespace {

constexpr size_t kMaxScenes = 2;
constexpr size_t kMaxRenderers = 4;
/// Attempts at getting tables or the files of a scene: a copy that was damaged on disk or on its way is thrown away and fetched
/// again.
constexpr int kFetchAttempts = 3;
/// Largest list of a scene's files, far above any real scene's.
constexpr uint64_t kMaxManifestBytes = uint64_t(64) << 20;

/// Time between checks of what another process is storing.
constexpr auto kOtherWorker = std::chrono::milliseconds(50);

/// A process id alone is not enough: containers that share the cache may all run as process 1.
std::string scratch_name() {
    std::random_device device;
    return "scenes-" + std::to_string(::getpid()) + "-" + std::to_string(device());
}

/// The error of a file that the coordinator has not, or not whole, as people need it.
Status named(const std::string& what, const Status& status) {
    if (status.code() != StatusCode::kNotFound && status.code() != StatusCode::kDataLoss) return status;
    return {status.code(),
            what + " is lost or damaged in the coordinator's store (" + status.message() + "); submit the scene again"};
}

/// A file of the cache that cannot be read or written is a fault of this host and not of the unit, which is what the code says.
Status of_host(const Status& status) {
    return status.code() == StatusCode::kInternal ? Status(StatusCode::kResourceExhausted, status.message()) : status;
}

}  // namespace

// "tables" is taken: the client keeps the table cache of its own coordinator there, by default below the same
// directory.
SceneFetcher::SceneFetcher(WorkerPort& port, std::filesystem::path directory, const CacheLimits& limits)
    : port_(port),
      scratch_(directory / scratch_name()),
      store_(directory / "assets"),
      table_store_(directory / "worker-tables"),
      limits_(limits) {}

SceneFetcher::~SceneFetcher() {
    std::error_code ignored;
    std::filesystem::remove_all(scratch_, ignored);
}

Status SceneFetcher::check_directory() const {
    std::error_code error;
    std::filesystem::create_directories(scratch_, error);
    if (error) return failed_precondition(scratch_.parent_path().string() + ": no files can be kept there: " + error.message());
    const std::string probe = scratch_ / "probe";
    LL_RETURN_IF_ERROR(write_file_atomically(probe, "probe"));
    std::filesystem::remove(probe, error);
    return {};
}

Status SceneFetcher::fetch(AssetStore& store, const Digest& digest, uint64_t size_bytes, std::stop_token stop) {
    while (!store.contains(digest)) {
        if (stop.stop_requested()) return {StatusCode::kCancelled, "stopped"};
        auto upload = store.begin_upload(digest, size_bytes);
        if (!upload.ok() && upload.status().code() == StatusCode::kAborted) {
            // Another worker on this host fetches the same file into the same directory.
            std::this_thread::sleep_for(kOtherWorker);
            continue;
        }
        if (!upload.ok()) return upload.status();
        Status status = port_.read_asset(digest, upload->offset(), [&](std::string_view bytes) -> Status {
            if (stop.stop_requested()) return {StatusCode::kCancelled, "stopped"};
            return upload->append(bytes);
        });
        if (status.code() == StatusCode::kDataLoss) upload->discard();
        if (status.ok()) status = upload->finish();
        if (status.code() == StatusCode::kAborted) continue;  // this worker stood still, and another one took over
        if (!status.ok()) return status;
    }
    return {};
}

Result<AssetManifest> SceneFetcher::file_list(const Digest& root, std::stop_token stop) {
    if (!store_.contains(root)) {
        std::string text;
        const Status got = port_.read_asset(root, 0, [&](std::string_view bytes) -> Status {
            if (text.size() + bytes.size() > kMaxManifestBytes)
                return {StatusCode::kInvalidArgument, "the scene's file list is too long"};
            text += bytes;
            return {};
        });
        if (!got.ok()) return named("the scene's file list", got);
        for (;;) {
            const Status status = store_.put(root, text);
            if (status.ok()) break;
            if (status.code() != StatusCode::kAborted) return status;
            // Another worker on this host stores the same list; if it dies meanwhile, the next attempt stores it.
            if (stop.stop_requested()) return Status(StatusCode::kCancelled, "stopped");
            std::this_thread::sleep_for(kOtherWorker);
        }
    }
    const auto text = store_.read(root);
    if (!text.ok()) {
        store_.remove(root);
        return data_loss(text.status().message());  // also if another worker has just removed a damaged one
    }
    return AssetManifest::parse(*text);
}

void SceneFetcher::keep_within_limit(const Digest& root, const AssetManifest& manifest) const {
    if (limits_.scenes == 0) return;
    store_.touch(root);
    for (const AssetEntry& entry : manifest.entries) store_.touch(entry.digest);
    store_.trim(limits_.scenes, root);
}

Result<AssetManifest> SceneFetcher::lay_out(const Digest& root, const std::filesystem::path& directory, std::stop_token stop) {
    Status status;
    for (int attempt = 0; attempt < kFetchAttempts; ++attempt) {
        auto manifest = file_list(root, stop);
        status = manifest.status();
        if (status.ok()) {
            for (const AssetEntry& entry : manifest->entries)
                if (status.ok())
                    status = named("\"" + entry.path + "\" of the scene", fetch(store_, entry.digest, entry.size_bytes, stop));
        }
        if (status.ok()) {
            status = store_.materialise(*manifest, directory);
            if (status.code() == StatusCode::kNotFound) status = data_loss(status.message());  // another worker has just removed it
        }
        if (status.ok()) {
            keep_within_limit(root, *manifest);
            return manifest;
        }
        if (status.code() != StatusCode::kDataLoss) return of_host(status);
        log_warn("files of scene {} are fetched again: {}", root.hex().substr(0, 12), status.message());
    }
    return status;
}

Result<std::shared_ptr<const Scene>> SceneFetcher::scene(const JobSpec& spec, std::stop_token stop) {
    const Digest& root = spec.scene_root;
    const std::filesystem::path directory = scratch_ / root.hex();
    const auto manifest = lay_out(root, directory, stop);
    if (!manifest.ok()) return manifest.status();
    // The scene may not refer to files outside of the directory.
    auto imported = import_pbrt((directory / manifest->main).string(), {.root = directory.string(), .without = manifest->without});
    std::error_code ignored;
    std::filesystem::remove_all(directory, ignored);
    if (!imported.ok()) return imported.status();
    auto scene = Scene::build(std::move(imported->description), scene_options(spec));
    if (!scene.ok()) return scene.status();
    log_info("scene {} built", root.hex().substr(0, 12));
    crash_point("worker.scene-read");
    return std::shared_ptr<const Scene>(std::move(scene).value());
}

Result<std::string> SceneFetcher::tables(const AssetReference& tables, std::stop_token stop) {
    Status status;
    for (int attempt = 0; attempt < kFetchAttempts; ++attempt) {
        status = fetch(table_store_, tables.digest, tables.size_bytes, stop);
        if (status.ok()) {
            auto bytes = table_store_.read(tables.digest);  // fails if another worker has just trimmed them away
            if (bytes.ok()) {
                table_store_.touch(tables.digest);
                table_store_.trim(limits_.tables, tables.digest);
                return bytes;
            }
            status = bytes.status();
            table_store_.remove(tables.digest);
        } else if (status.code() == StatusCode::kInvalidArgument || status.code() == StatusCode::kOutOfRange) {
            // More or fewer bytes than announced: the coordinator's file was cut short, or the rest of an earlier
            // attempt is wrong.
            status = data_loss("the tables have the wrong size: " + status.message());
        } else if (status.code() != StatusCode::kDataLoss) {
            return of_host(status);
        }
        log_warn("tables {} are fetched again: {}", tables.digest.hex().substr(0, 12), status.message());
    }
    return status;
}

TableSource direct_tables(WorkerPort& port) {
    return [&port](const AssetReference& tables, std::stop_token stop) -> Result<std::string> {
        std::string bytes;
        LL_RETURN_IF_ERROR(port.read_asset(tables.digest, 0, [&](std::string_view part) -> Status {
            if (stop.stop_requested()) return {StatusCode::kCancelled, "stopped"};
            if (part.size() > tables.size_bytes - bytes.size()) return data_loss("more bytes than announced");
            bytes += part;
            return {};
        }));
        if (sha256(bytes) != tables.digest) return data_loss("the bytes do not have the digest");
        return bytes;
    };
}

Result<std::shared_ptr<const Scene>> RendererCache::scene(const JobSpec& spec, std::stop_token stop) {
    std::shared_ptr<const Scene> scene;
    for (auto item = scene_entries_.begin(); item != scene_entries_.end(); ++item) {
        if (item->root != spec.scene_root || item->width != spec.width || item->height != spec.height || item->crop != spec.crop)
            continue;
        scene_entries_.splice(scene_entries_.begin(), scene_entries_, item);
        scene = item->scene;
        break;
    }
    if (!scene) {
        auto built = scenes_(spec, stop);
        if (!built.ok()) return built.status();
        scene = *std::move(built);
        scene_entries_.push_front({spec.scene_root, spec.width, spec.height, spec.crop, scene});
        if (scene_entries_.size() > kMaxScenes) scene_entries_.pop_back();
    }
    if (scene->frame() != spec.frame)
        return failed_precondition("this worker reads another frame from the scene than the coordinator did");
    return scene;
}

Result<Tables> RendererCache::tables(const UnitLease& lease, const Scene& scene, std::stop_token stop) {
    const AssetReference& asset = lease.tables;
    if (asset.size_bytes == 0) return Tables();
    const auto bytes = tables_(asset, stop);
    if (!bytes.ok()) {
        if (bytes.status().code() == StatusCode::kCancelled) return bytes.status();
        return Status(bytes.status().code(),
                      "this worker cannot get the tables " + asset.digest.hex() + ": " + bytes.status().message());
    }
    const LearningInfo* learning = lease.spec.algorithm.learning();
    if (!learning) return failed_precondition("algorithm '" + lease.spec.algorithm.name() + "' reads no tables");
    auto tables = parse_tables(*bytes, learning->parts);
    Status status = tables.ok() ? tables->validate(scene.emitters()) : tables.status();
    if (!status.ok())
        return failed_precondition("the tables " + asset.digest.hex() + " do not fit this scene: " + status.message());
    return *std::move(tables);
}

Result<std::shared_ptr<const Renderer>> RendererCache::renderer(const UnitLease& lease, std::stop_token stop) {
    const Digest image = lease.spec.spec_digest();
    const std::lock_guard lock(mutex_);
    for (auto item = renderer_entries_.begin(); item != renderer_entries_.end(); ++item) {
        if (item->image != image || item->tables != lease.tables.digest) continue;
        renderer_entries_.splice(renderer_entries_.begin(), renderer_entries_, item);
        return item->renderer;
    }
    const auto built = scene(lease.spec, stop);
    if (!built.ok()) return built.status();
    auto learned = tables(lease, **built, stop);
    if (!learned.ok()) return learned.status();
    auto renderer = Renderer::create(*built, render_settings(lease.spec), *learned);
    if (!renderer.ok()) return renderer.status();
    std::shared_ptr<const Renderer> shared = std::move(renderer).value();
    renderer_entries_.push_front({image, lease.tables.digest, shared});
    tracer_ = {};  // it holds a scene and tables, and a job that renders has finished tracing
    if (renderer_entries_.size() > kMaxRenderers) renderer_entries_.pop_back();
    return shared;
}

Result<TrainingTracer> RendererCache::tracer(const UnitLease& lease, std::stop_token stop) {
    const Digest image = lease.spec.spec_digest();
    const std::lock_guard lock(mutex_);
    if (tracer_ && tracer_image_ == image && tracer_guide_ == lease.tables.digest) return tracer_;
    const auto built = scene(lease.spec, stop);
    if (!built.ok()) return built.status();
    const auto guide = tables(lease, **built, stop);
    if (!guide.ok()) return guide.status();
    auto generator = TrainingGenerator::create(**built, render_settings(lease.spec), *guide);
    if (!generator.ok()) return generator.status();
    tracer_image_ = image, tracer_guide_ = lease.tables.digest;
    tracer_ = [scene = *built, generator = *std::move(generator)](const TrainingWork& work, std::stop_token unit_stop) {
        return generator.trace(work, unit_stop);
    };
    return tracer_;
}

}  // namespace lightloom
