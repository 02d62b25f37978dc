#pragma once
// A service that makes tables, for tests: real light, in a scene of a few triangles, with training units that a test holds in
// its own hands.

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/core/atomic_file.h"
#include "common/transport/training.h"
#include "common/work/golden.h"
#include "server/grpc_services.h"
#include "server/results.h"
#include "server/scene_reader.h"
#include "server/training_budget.h"
#include "tests/service/fake.h"
#include "worker/grpc_worker_port.h"
#include "worker/scene_cache.h"

namespace lightloom::testing {

inline const FrameLayout kFrame{32, 32, {0, 0, 32, 32}};
inline constexpr uint64_t kSamples = 3 * kTrainingUnitSamples - 5000;

inline std::shared_ptr<const Scene> golden() {
    static const std::shared_ptr<const Scene> scene = std::move(Scene::build(golden_scene())).value();
    return scene;
}

inline SceneFacts golden_facts() {
    return {kFrame, {}, 5, {}, [] { return Result<std::shared_ptr<const Scene>>(golden()); }};
}

/// A service that makes tables of the golden scene.
struct TableService : FakeService {
    explicit TableService(const std::function<void(CoordinatorOptions&)>& change = {},
                          std::optional<uint64_t> shuffle = std::nullopt)
        : FakeService(kFrame, shuffle, [change](CoordinatorOptions& o) {
              o.read_scene = [](const AssetStore&, const JobSpec&, std::stop_token) { return Result<SceneFacts>(golden_facts()); };
              if (change) change(o);
          }) {}
    JobSpec table_spec(uint32_t spp = 2) const {
        JobSpec s = spec(spp);
        s.algorithm = algorithm_of("spcbpt", {{"training-paths", std::to_string(kSamples)},
                                              {"cache", "500"},
                                              {"light-subspaces", "40"},
                                              {"eye-subspaces", "20"},
                                              {"pilot", "0"}});
        return s;
    }
    /// The same, with a pilot of one unit and a guided round of two.
    JobSpec guided_spec(uint32_t spp = 2) const {
        JobSpec s = table_spec(spp);
        s.algorithm = without(s.algorithm, "pilot");
        return s;
    }
    std::string submit_now(const JobSpec& s) {
        const auto job = coordinator->submit_job("request-" + std::to_string(++requests), s);
        EXPECT_TRUE(job.ok()) << job.status().message();
        return job.ok() ? job->job_id : "";
    }
    /// Up to the phase in which units can be leased.
    std::string submit_training(const JobSpec& s) {
        const std::string id = submit_now(s);
        wait(id, [](const JobInfo& j) { return j.phase_total > 0 || j.state != JobState::kPreparing; });
        return id;
    }
    /// As if tracing had taken `seconds`.
    SubmitAck give(const std::string& worker, const UnitLease& lease, const std::string& payload, const Digest& digest,
                   double seconds = 0.1) {
        const auto ack = coordinator->submit_training(worker, lease.reference(), digest, payload, seconds);
        EXPECT_TRUE(ack.ok()) << ack.status().message();
        return ack.ok() ? *ack : SubmitAck{SubmitOutcome::kRejected, "error"};
    }
    SubmitAck give(const std::string& worker, const UnitLease& lease, const std::string& payload) {
        return give(worker, lease, payload, sha256(payload));
    }
};

/// What a worker makes of a training unit; remembered, because many tests trace the same ones.
inline const std::string& traced(const UnitLease& lease) {
    static std::map<std::tuple<Digest, uint64_t, uint64_t>, std::string> memory;
    const TrainingWork& work = lease.unit.training;
    std::string& payload = memory[{lease.spec.spec_digest(), work.first_sample, work.total_samples}];
    if (payload.empty()) payload = serialize(*TrainingGenerator::create(*golden(), render_settings(lease.spec))->trace(work, {}));
    return payload;
}

/// All training units of the running phase, in the hands of as many workers as it takes.
inline std::vector<std::pair<std::string, UnitLease>> lease_all(TableService& service) {
    std::vector<std::pair<std::string, UnitLease>> held;
    for (;;) {
        const std::string worker = service.add_worker();
        const auto leases = service.lease(worker);
        if (leases.empty()) return held;
        held.emplace_back(worker, leases[0]);
    }
}

inline Digest tables_alone(const JobSpec& spec) {
    JobSpec whole = spec;
    whole.max_depth = 5;
    TrainingReport report;
    return sha256(serialize(*make_tables(*golden(), render_settings(whole), {}, &report)));
}

/// Submits and delivers all training units, in order; the job then renders. Those who delivered leave.
inline std::string train_by_hand(TableService& service, const JobSpec& spec) {
    const std::string id = service.submit_training(spec);
    for (const auto& [worker, lease] : lease_all(service))
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    for (const WorkerStatus& worker : service.coordinator->workers())
        if (worker.state != WorkerState::kGone) (void)service.coordinator->goodbye(worker.worker_id);
    return id;
}

}  // namespace lightloom::testing
