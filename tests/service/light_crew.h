#pragma once
// Workers with real light, all in this process.

#include "tests/service/fake.h"
#include "worker/scene_cache.h"

namespace lightloom::testing {

/// Of a worker that cannot get any.
inline Result<std::string> no_tables(const AssetReference&, std::stop_token) { return data_loss("the disk is broken"); }

/// They run until the object goes.
class LightCrew {
  public:
    explicit LightCrew(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {}
    /// Without a source, its tables come through the port.
    void add(std::unique_ptr<WorkerPort> port, const BuildIdentity& identity, uint32_t threads = 1, TableSource tables = {}) {
        ports_.push_back(std::move(port));
        WorkerPort& p = *ports_.back();
        caches_.push_back(std::make_unique<RendererCache>(
            [scene = scene_](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(scene); },
            tables ? std::move(tables) : direct_tables(p)));
        RendererCache& cache = *caches_.back();
        workers_.push_back(std::make_unique<Worker>(
            p, WorkerOptions{.identity = identity, .thread_count = threads, .host = "h", .process_id = workers_.size()},
            cache.renderer_source(), cache.tracer_source()));
        threads_.emplace_back([w = workers_.back().get()](std::stop_token stop) { EXPECT_TRUE(w->run(stop).ok()); });
    }
    ~LightCrew() {
        for (std::jthread& t : threads_) t.request_stop();
    }

  private:
    const std::shared_ptr<const Scene> scene_;
    std::vector<std::unique_ptr<WorkerPort>> ports_;
    std::vector<std::unique_ptr<RendererCache>> caches_;
    std::vector<std::unique_ptr<Worker>> workers_;
    std::vector<std::jthread> threads_;
};

}  // namespace lightloom::testing
