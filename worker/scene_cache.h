#pragma once
// Where a worker's scenes come from: fetched by digest into a directory that outlives the process, imported and built once per
// (root, resolution), and kept while recent jobs need them.

#include <filesystem>
#include <list>
#include <mutex>

#include "common/scene/scene.h"
#include "worker/worker.h"

namespace lightloom {

/// The built scene of a job.
using SceneSource = std::function<Result<std::shared_ptr<const Scene>>(const JobSpec& spec, std::stop_token stop)>;

/// Fetches from the coordinator behind `port`. `directory` may be shared by several workers of a host.
class SceneFetcher {
  public:
    SceneFetcher(WorkerPort& port, std::filesystem::path directory);
    ~SceneFetcher();
    Result<std::shared_ptr<const Scene>> scene(const JobSpec& spec, std::stop_token stop);

  private:
    Status fetch(const Digest& digest, uint64_t size_bytes, std::stop_token stop);

    WorkerPort& port_;
    std::filesystem::path scratch_;  ///< Of this process; removed at the end.
    AssetStore store_;
};

/// Keeps the last few scenes and renderers.
class RendererCache {
  public:
    explicit RendererCache(SceneSource scenes) : scenes_(std::move(scenes)) {}
    Result<std::shared_ptr<const Renderer>> renderer(const JobSpec& spec, std::stop_token stop);

  private:
    struct SceneEntry {
        Digest root;
        int width = 0, height = 0;
        std::shared_ptr<const Scene> scene;
    };
    struct RendererEntry {
        Digest image;
        std::shared_ptr<const Renderer> renderer;
    };
    std::mutex mutex_;  ///< Held while a scene is built: a second caller would only build it again.
    SceneSource scenes_;
    std::list<SceneEntry> scene_entries_;        // most recent first
    std::list<RendererEntry> renderer_entries_;  // most recent first
};

}  // namespace lightloom
