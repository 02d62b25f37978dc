#pragma once
// Where a worker's scenes and tables come from: fetched by digest into a directory that outlives the process, verified
// whenever they are read from there, built once per scene, resolution and crop window, and kept while recent jobs need them.

#include <filesystem>
#include <list>
#include <mutex>

#include "common/scene/scene.h"
#include "worker/worker.h"

namespace lightloom {

/// The built scene of a job.
using SceneSource = std::function<Result<std::shared_ptr<const Scene>>(const JobSpec& spec, std::stop_token stop)>;

/// The bytes of a job's tables, verified against their digest.
using TableSource = std::function<Result<std::string>(const AssetReference& tables, std::stop_token stop)>;
/// A table source without a directory, for workers in the coordinator's process. `port` must outlive it.
TableSource direct_tables(WorkerPort& port);

/// Most bytes that are kept.
struct CacheLimits {
    uint64_t tables = uint64_t(1) << 30;
    uint64_t scenes = 0;  ///< 0: no limit.
};

/// Fetches from the coordinator behind `port`. `directory` may be shared by several workers of a host. Above a limit, the least
/// recently used tables or scene files in it are removed.
class SceneFetcher {
  public:
    SceneFetcher(WorkerPort& port, std::filesystem::path directory, const CacheLimits& limits = {});
    ~SceneFetcher();
    /// Whether files can be stored there; a worker that cannot fails every unit that it gets.
    Status check_directory() const;
    Result<std::shared_ptr<const Scene>> scene(const JobSpec& spec, std::stop_token stop);
    Result<std::string> tables(const AssetReference& tables, std::stop_token stop);

  private:
    Status fetch(AssetStore& store, const Digest& digest, uint64_t size_bytes, std::stop_token stop);
    Result<AssetManifest> file_list(const Digest& root, std::stop_token stop);
    /// Fetches the files of a scene and puts them into `directory` under their names. What is damaged, or what another worker has
    /// just removed, is fetched again.
    Result<AssetManifest> lay_out(const Digest& root, const std::filesystem::path& directory, std::stop_token stop);

    /// Marks the files of this scene as used, and removes others above the limit.
    void keep_within_limit(const Digest& root, const AssetManifest& manifest) const;

    WorkerPort& port_;
    std::filesystem::path scratch_;  ///< Belongs to this process; removed at the end.
    AssetStore store_;               ///< Scene files, and the lists of them.
    AssetStore table_store_;
    const CacheLimits limits_;
};

/// Keeps the last few scenes and renderers, and the last tracer.
class RendererCache {
  public:
    RendererCache(SceneSource scenes, TableSource tables) : scenes_(std::move(scenes)), tables_(std::move(tables)) {}
    /// Fails, naming the tables, when these are unavailable or do not fit the scene.
    Result<std::shared_ptr<const Renderer>> renderer(const UnitLease& lease, std::stop_token stop);
    /// The same for the tables that guide a training unit, if it has any.
    Result<TrainingTracer> tracer(const UnitLease& lease, std::stop_token stop);
    /// Both functions in the form that a Worker takes; the cache must outlive it.
    RendererSource renderer_source() {
        return [this](const UnitLease& lease, std::stop_token stop) { return renderer(lease, std::move(stop)); };
    }
    TracerSource tracer_source() {
        return [this](const UnitLease& lease, std::stop_token stop) { return tracer(lease, std::move(stop)); };
    }

  private:
    Result<std::shared_ptr<const Scene>> scene(const JobSpec& spec, std::stop_token stop);
    Result<Tables> tables(const UnitLease& lease, const Scene& scene, std::stop_token stop);

    struct SceneEntry {
        Digest root;
        int width = 0, height = 0;
        Rect crop;
        std::shared_ptr<const Scene> scene;
    };
    struct RendererEntry {
        Digest image, tables;
        std::shared_ptr<const Renderer> renderer;
    };
    std::mutex mutex_;  ///< Held while a scene is built: a second caller would only build it again.
    SceneSource scenes_;
    TableSource tables_;
    std::list<SceneEntry> scene_entries_;        // most recent first
    std::list<RendererEntry> renderer_entries_;  // most recent first
    Digest tracer_image_, tracer_guide_;         // of the last tracer
    TrainingTracer tracer_;
};

}  // namespace lightloom
