#pragma once
// A service without light: partials that are a pure function of the unit, and a coordinator whose clock the test turns.

#include <atomic>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include "common/cli/log.h"
#include "common/core/rng.h"
#include "server/coordinator.h"
#include "server/local_ports.h"
#include "tests/support/algorithm_of.h"
#include "tests/support/temp_directory.h"
#include "worker/worker.h"

namespace lightloom::testing {

/// As in the programs, the log is set up before there are threads.
inline const bool kLogging = (set_up_logging("test", "info"), true);

/// Pixels of widely different size, so that a sum that depended on its order would show.
inline Partial fake_partial(const RenderUnit& work, const FrameLayout& frame) {
    Partial partial;
    partial.tile = work.tile;
    partial.samples_per_pixel = work.samples_per_pixel();
    partial.light_paths = work.light_path_count;
    partial.camera.assign(size_t(3 * work.tile.area()), 0.0);
    for (int y = work.tile.y0; y < work.tile.y1; ++y) {
        for (int x = work.tile.x0; x < work.tile.x1; ++x) {
            double* sum = &partial.camera[size_t(3 * work.tile.index(x, y))];
            for (uint32_t i = 0; i < work.samples_per_pixel(); ++i) {
                Rng rng({1, Stage::kCamera, work.first_iteration + i, uint64_t(frame.crop.index(x, y))});
                const double scale = double(uint64_t(1) << (rng.next_u64() % 40)) * 1e-6;
                for (int c = 0; c < 3; ++c) sum[c] += scale * rng.uniform_double();
            }
        }
    }
    Rng rng({1, Stage::kLight, work.group_first_iteration, work.first_light_path});
    for (uint32_t p = 0; p < uint32_t(frame.crop.area()); p += 1 + rng.below(3))
        partial.splats.push_back({p, {1 + rng.uniform_double(), rng.uniform_double(), 1e-3 * rng.uniform_double()}});
    partial.counters.camera_samples = uint64_t(work.tile.area()) * work.samples_per_pixel();
    return partial;
}

/// Renders fake partials; takes `seconds` for each and gives up when told to.
class FakeRenderer final : public Renderer {
  public:
    FakeRenderer(FrameLayout frame, double seconds) : frame_(frame), seconds_(seconds) {}
    Result<Partial> render(const RenderUnit& work, std::stop_token stop) const override {
        const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds_);
        while (std::chrono::steady_clock::now() < end) {
            if (stop.stop_requested()) return Status(StatusCode::kCancelled, "stopped");
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return fake_partial(work, frame_);
    }
    Result<Partial> watch(const RenderUnit& work, const std::function<void(const SeenContribution&)>&,
                          std::stop_token stop) const override {
        return render(work, stop);
    }
    RareLight rare_light(std::stop_token) const override { return {}; }
    std::unique_ptr<PathWeights> weights() const override { return nullptr; }

  private:
    FrameLayout frame_;
    double seconds_;
};

inline RendererSource fake_renderers(double seconds = 0) {
    return [seconds](const UnitLease& lease, std::stop_token) -> Result<std::shared_ptr<const Renderer>> {
        return std::shared_ptr<const Renderer>(std::make_shared<FakeRenderer>(lease.spec.frame, seconds));
    };
}

/// For workers that never see a training unit.
inline TracerSource no_tracers() {
    return [](const UnitLease&, std::stop_token) -> Result<TrainingTracer> { return internal_error("no light here"); };
}

struct FakeService {
    explicit FakeService(FrameLayout frame = {40, 30, {0, 0, 40, 30}}, std::optional<uint64_t> shuffle = std::nullopt,
                         const std::function<void(CoordinatorOptions&)>& change = {}) {
        identity = {"build", "profile", sha256("golden")};
        const AssetManifest manifest{"scene.pbrt", {{"scene.pbrt", sha256("scene"), 5}}};
        root = manifest.root();
        options.directory = directory.path;
        options.identity = identity;
        options.scene_files_needed = false;
        options.read_scene = [frame](const AssetStore&, const JobSpec&, std::stop_token) {
            return Result<SceneFacts>(SceneFacts{frame, {}, 5});
        };
        options.shuffle_seed = shuffle;
        options.clock = [this] { return TimePoint(std::chrono::milliseconds(now_ms)); };
        options.longest_sleep_seconds = 0.02;  // nobody tells the ticker that the clock was turned
        if (change) change(options);
        start();
        EXPECT_TRUE(coordinator->assets().put(root, manifest.canonical_text()).ok());
    }

    /// With `durable`, of a coordinator that keeps jobs.
    void start() {
        std::unique_ptr<JobStore> store;
        if (durable) {
            auto opened = JobStore::open({.directory = directory.file("store")});
            ASSERT_TRUE(opened.ok()) << opened.status().message();
            store = *std::move(opened);
        }
        coordinator = std::make_unique<Coordinator>(options, std::move(store));
        EXPECT_TRUE(coordinator->restored().ok()) << coordinator->restored().message();
    }
    /// The coordinator is stopped, and another one begins in the same directory.
    void restart() {
        coordinator.reset();
        start();
    }

    JobSpec spec(uint32_t spp) const {
        JobSpec s;
        s.algorithm = algorithm_of("bdpt");
        s.samples_per_pixel = spp;
        s.scene_root = root;
        return s;
    }
    std::string submit(const JobSpec& s) {
        const auto job = coordinator->submit_job("request-" + std::to_string(++requests), s);
        EXPECT_TRUE(job.ok()) << job.status().message();
        return job.ok() ? wait(job->job_id, [](const JobInfo& j) { return j.state != JobState::kPreparing; }).job_id : "";
    }
    JobInfo wait(const std::string& id, const std::function<bool(const JobInfo&)>& until) {
        JobInfo info;
        for (int i = 0; i < 12000; ++i) {  // a minute: sanitizers on a busy machine take their time
            info = *coordinator->get_job(id);
            if (until(info)) return info;
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ADD_FAILURE() << "job " << id << " stays " << to_string(info.state);
        return info;
    }
    JobInfo wait_running(const std::string& id) {
        return wait(id, [](const JobInfo& job) { return job.state != JobState::kPreparing; });
    }
    JobInfo wait_end(const std::string& id) {
        return wait(id, [](const JobInfo& j) { return is_terminal(j.state); });
    }
    std::string add_worker() { return coordinator->register_worker({identity, 1, "host", 1})->worker_id; }
    std::vector<UnitLease> lease(const std::string& worker) {
        auto leases = coordinator->lease_units(worker, 0, [] { return false; });
        EXPECT_TRUE(leases.ok());
        return leases.ok() ? *leases : std::vector<UnitLease>();
    }
    SubmitAck deliver(const std::string& worker, const UnitLease& lease) {
        const auto encoded = encode_partial(fake_partial(lease.unit.render, lease.spec.frame), lease.spec.frame);
        const auto ack = coordinator->submit_payload(worker, lease.reference(), encoded->descriptor, encoded->payload);
        EXPECT_TRUE(ack.ok()) << ack.status().message();
        return ack.ok() ? *ack : SubmitAck{SubmitOutcome::kRejected, "error"};
    }

    TempDirectory directory;
    BuildIdentity identity;
    Digest root;
    std::atomic<int64_t> now_ms{1000000};
    int requests = 0;
    bool durable = false;
    CoordinatorOptions options;
    std::unique_ptr<Coordinator> coordinator;
};

}  // namespace lightloom::testing
