#pragma once
// A complete worker: scenes and tables of its units are fetched through its port into a directory, and kept.

#include "worker/scene_cache.h"
#include "worker/worker.h"

namespace lightloom {

class FetchingWorker {
  public:
    /// `port` must outlive the worker; for `directory` see SceneFetcher.
    FetchingWorker(WorkerPort& port, const std::filesystem::path& directory, WorkerOptions options, const CacheLimits& limits = {});
    Status check_directory() const { return fetcher_.check_directory(); }
    Status run(std::stop_token stop) { return worker_.run(std::move(stop)); }

  private:
    SceneFetcher fetcher_;
    RendererCache renderers_;
    Worker worker_;
};

}  // namespace lightloom
