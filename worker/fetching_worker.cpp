#include "worker/fetching_worker.h"

namespace lightloom {

FetchingWorker::FetchingWorker(WorkerPort& port, const std::filesystem::path& directory, WorkerOptions options,
                               const CacheLimits& limits)
    : fetcher_(port, directory, limits),
      renderers_([this](const JobSpec& spec, std::stop_token stop) { return fetcher_.scene(spec, stop); },
                 [this](const AssetReference& tables, std::stop_token stop) { return fetcher_.tables(tables, stop); }),
      worker_(port, std::move(options), renderers_.renderer_source(), renderers_.tracer_source()) {}

}  // namespace lightloom
