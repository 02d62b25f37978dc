// Tables on their way: the broadcast, damaged copies, and training under a time limit.

#include <arpa/inet.h>
#include <sys/socket.h>

#include "tests/service/forwarding_port.h"
#include "tests/service/light_crew.h"
#include "tests/service/table_service.h"

namespace lightloom {
namespace {

using namespace lightloom::testing;

/// Bytes that arrive damaged, the first few times.
class NoisyPort final : public ForwardingPort {
  public:
    NoisyPort(WorkerPort& port, int damaged_reads) : ForwardingPort(port), damaged_(damaged_reads) {}
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                      double seconds) override {
        double none = 0;
        first_trace_seconds.compare_exchange_strong(none, seconds);
        return port_.submit_training(worker_id, lease, payload, seconds);
    }
    Status read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) override {
        ++reads;
        const bool damage = damaged_ > 0 && damaged_-- > 0;
        return port_.read_asset(digest, offset, [&](std::string_view bytes) {
            std::string copy(bytes);
            if (damage && !copy.empty()) copy[copy.size() / 3] ^= 16;
            return sink(copy);
        });
    }
    std::atomic<int> reads{0};
    std::atomic<double> first_trace_seconds{0};

  private:
    std::atomic<int> damaged_;
};

TEST(Broadcast, DamagedTablesAreFetchedAgain) {
    TableService service;
    LocalWorkerPort local(*service.coordinator);
    const std::string bytes = serialize(Tables(trivial_tables(golden()->emitters())));
    const AssetReference asset{sha256(bytes), bytes.size()};
    ASSERT_TRUE(service.coordinator->assets().put(asset.digest, bytes).ok());
    const TempDirectory directory;
    NoisyPort port(local, 1);
    SceneFetcher fetcher(port, directory.path);
    auto got = fetcher.tables(asset, {});
    ASSERT_TRUE(got.ok()) << got.status().message();
    EXPECT_EQ(*got, bytes);
    EXPECT_EQ(port.reads, 2) << "the first came damaged";
    EXPECT_TRUE(fetcher.tables(asset, {}).ok());
    EXPECT_EQ(port.reads, 2) << "they travel once";
    const std::filesystem::path file = AssetStore(directory.path / "worker-tables").path_of(asset.digest);
    std::string damaged = bytes;
    damaged[damaged.size() / 2] ^= 1;
    ASSERT_TRUE(write_file_atomically(file.string(), damaged).ok());
    got = fetcher.tables(asset, {});
    ASSERT_TRUE(got.ok()) << got.status().message();
    EXPECT_EQ(*got, bytes);
    EXPECT_EQ(port.reads, 3);
    const TempDirectory elsewhere;
    NoisyPort broken(local, 1000);
    SceneFetcher helpless(broken, elsewhere.path);
    EXPECT_EQ(helpless.tables(asset, {}).status().code(), StatusCode::kDataLoss);
}

TEST(Broadcast, ShortenedTablesAreFetchedAgain) {
    TableService service;
    LocalWorkerPort local(*service.coordinator);
    AssetStore& assets = service.coordinator->assets();
    const std::string bytes = serialize(Tables(trivial_tables(golden()->emitters())));
    const AssetReference asset{sha256(bytes), bytes.size()};
    ASSERT_TRUE(assets.put(asset.digest, bytes).ok());
    const TempDirectory directory, elsewhere;
    NoisyPort port(local, 0);
    SceneFetcher fetcher(port, directory.path);
    ASSERT_TRUE(fetcher.tables(asset, {}).ok());
    int reads = 1;
    for (const size_t size : {bytes.size() - 1, bytes.size() / 2, size_t(0)}) {
        std::filesystem::resize_file(AssetStore(directory.path / "worker-tables").path_of(asset.digest), size);
        const auto got = fetcher.tables(asset, {});
        ASSERT_TRUE(got.ok()) << size << ": " << got.status().message();
        EXPECT_EQ(*got, bytes) << size;
        EXPECT_EQ(port.reads, ++reads) << size;
    }
    // The coordinator's copy, over the wire: what came of it is no use later, but does not stand in the way either.
    const auto server = GrpcServer::start(*service.coordinator, "127.0.0.1:0");
    ASSERT_TRUE(server.ok()) << server.status().message();
    GrpcWorkerPort wire(grpc::CreateChannel("127.0.0.1:" + std::to_string((*server)->port()), grpc::InsecureChannelCredentials()));
    std::filesystem::resize_file(assets.path_of(asset.digest), bytes.size() / 2);
    SceneFetcher other(wire, elsewhere.path);
    const Status lost = other.tables(asset, {}).status();
    EXPECT_EQ(lost.code(), StatusCode::kNotFound) << "it was noticed there, and asked for once more: " << lost.message();
    EXPECT_FALSE(assets.contains(asset.digest));
    ASSERT_TRUE(assets.put(asset.digest, bytes).ok());
    const auto got = other.tables(asset, {});
    ASSERT_TRUE(got.ok()) << got.status().message();
    EXPECT_EQ(*got, bytes);
}

TEST(Broadcast, ACoordinatorThatDoesNotAnswerIsGivenUp) {
    const int listener = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    ASSERT_EQ(::bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::listen(listener, 4), 0);
    ASSERT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &length), 0);
    const std::string target = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    GrpcWorkerPort port(grpc::CreateChannel(target, grpc::InsecureChannelCredentials()), 0.3);
    const auto begin = std::chrono::steady_clock::now();
    const Status status = port.read_asset(sha256("x"), 0, [](std::string_view) { return Status(); });
    EXPECT_EQ(status.code(), StatusCode::kDeadlineExceeded) << status.message();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
    ::close(listener);
}

JobInfo run(int workers, bool over_grpc, const std::function<JobSpec(const TableService&)>& spec) {
    TableService service({}, workers);
    std::unique_ptr<GrpcServer> server;
    if (over_grpc) server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    LightCrew crew(golden());
    const auto add = [&] {
        if (over_grpc) {
            crew.add(std::make_unique<GrpcWorkerPort>(
                         grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()), grpc::InsecureChannelCredentials())),
                     service.identity);
        } else {
            crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity);
        }
    };
    const std::string id = service.submit_now(spec(service));
    for (int i = 0; i + 1 < workers; ++i) add();
    if (workers > 1) service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    add();  // the last one comes late
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    return info;
}

TEST(Broadcast, BytesDoNotDependOnWhoTracedAndRendered) {
    for (const std::string algorithm : {"spcbpt", "spcbpt, one round", "lvcbpt"}) {
        const auto spec = [&](const TableService& service) {
            JobSpec s = algorithm == "spcbpt" ? service.guided_spec(6) : service.table_spec(6);
            if (algorithm == "lvcbpt") s.algorithm = algorithm_of(algorithm, {{"training-paths", "20000"}, {"cache", "500"}});
            return s;
        };
        const JobInfo reference = run(1, false, spec);
        for (const int workers : {2, 4}) {
            const JobInfo info = run(workers, workers == 4, spec);
            EXPECT_EQ(info.image_digest, reference.image_digest) << algorithm << " " << workers;
            EXPECT_EQ(info.tables.asset.digest, reference.tables.asset.digest) << algorithm << " " << workers;
        }
    }
}

TEST(Broadcast, AWorkerWithoutTheTablesRefusesAndOthersRender) {
    TableService service;
    const std::string id = train_by_hand(service, service.table_spec(3));
    LightCrew crew(golden());
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity, 1, no_tables);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(service.coordinator->get_job(id)->unit_done, 0u);
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity);
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;

    TableService alone;
    const std::string stuck = train_by_hand(alone, alone.table_spec(1));
    const Digest digest = alone.coordinator->get_job(stuck)->tables.asset.digest;
    for (int i = 0; i < 3; ++i) {
        LocalWorkerPort port(*alone.coordinator);
        RendererCache cache(
            [](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(golden()); },
            [](const AssetReference&, std::stop_token) -> Result<std::string> { return data_loss("the disk is broken"); });
        const std::string worker = alone.add_worker();
        const UnitLease lease = alone.lease(worker).at(0);
        const auto renderer = cache.renderer(lease, {});
        ASSERT_FALSE(renderer.ok());
        ASSERT_TRUE(alone.coordinator->release_unit(worker, lease.reference(), renderer.status()).ok());
    }
    const JobInfo failed = alone.wait_end(stuck);
    EXPECT_EQ(failed.state, JobState::kFailed);
    EXPECT_NE(failed.message.find("cannot get the tables " + digest.hex()), std::string::npos) << failed.message;
}

TEST(Broadcast, TablesDamagedAtTheCoordinatorAreRestored) {
    for (const auto& [copy, shortened] : {std::pair(true, false), std::pair(true, true), std::pair(false, false)}) {
        TempDirectory cache;
        TableService service([&, keep = copy](CoordinatorOptions& o) {
            if (keep) o.table_cache = cache.path;
        });
        const std::string id = train_by_hand(service, service.table_spec(2));
        const AssetReference asset = service.coordinator->get_job(id)->tables.asset;
        std::string bytes = *service.coordinator->assets().read(asset.digest);
        bytes[bytes.size() / 2] ^= 1;
        if (shortened) bytes.resize(bytes.size() / 2);
        ASSERT_TRUE(write_file_atomically(service.coordinator->assets().path_of(asset.digest).string(), bytes).ok());
        LightCrew crew(golden());
        crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity);
        const JobInfo info = service.wait_end(id);
        EXPECT_EQ(info.state, copy ? JobState::kSucceeded : JobState::kFailed) << info.message;
        EXPECT_EQ(info.message.find("damaged on the coordinator's disk") != std::string::npos, !copy) << info.message;
    }
}

TEST(TrainingBudget, IsTheLargestPowerOfTwoThatFits) {
    const TrainingRate rate{1e-5, 1e-5};
    EXPECT_EQ(affordable_training_samples(rate, 4.1, 200000), 200000u);
    EXPECT_EQ(affordable_training_samples(rate, 3.9, 200000), 131072u);
    EXPECT_EQ(affordable_training_samples(rate, 1.0, 200000), 32768u);
    EXPECT_EQ(affordable_training_samples(rate, -1, 200000), kMinTrainingSamples);
    EXPECT_EQ(affordable_training_samples(rate, -1, 700), 700u);
}

/// What a worker spends once, on its threads and its first look at the scene, is no price of a sample.
TEST(TrainingBudget, AProbeIsTimedOnAWarmWorker) {
    constexpr double kColdSeconds = 2;
    TableService service([](CoordinatorOptions& o) { o.clock = [] { return std::chrono::steady_clock::now(); }; });
    LocalWorkerPort local(*service.coordinator);
    NoisyPort port(local, 0);
    std::mutex mutex;
    std::vector<uint64_t> traced_counts;
    const auto trace = [&](const JobSpec& spec, const TrainingWork& work, std::stop_token stop) {
        bool cold = false;
        {
            const std::lock_guard lock(mutex);
            cold = traced_counts.empty();
            traced_counts.push_back(work.sample_count);
        }
        if (cold) std::this_thread::sleep_for(std::chrono::duration<double>(kColdSeconds));
        return TrainingGenerator::create(*golden(), render_settings(spec))->trace(work, stop);
    };
    const auto tracers = [&](const UnitLease& lease, std::stop_token) -> Result<TrainingTracer> {
        return TrainingTracer(
            [&trace, spec = lease.spec](const TrainingWork& work, std::stop_token stop) { return trace(spec, work, stop); });
    };
    Worker worker(port, {.identity = service.identity, .thread_count = 1, .host = "h"}, testing::fake_renderers(0.001), tracers);
    std::jthread thread([&](std::stop_token stop) { EXPECT_TRUE(worker.run(stop).ok()); });
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 20;
    timed.algorithm = without(timed.algorithm, "training-paths");
    const std::string id = service.submit_now(timed);
    service.wait(id, [](const JobInfo& j) { return j.phase == PreparePhase::kTracing; });
    EXPECT_TRUE(service.coordinator->cancel_job(id).ok());
    const auto probe = uint64_t(20 * kProbeSamplesPerSecond);
    const std::lock_guard lock(mutex);
    ASSERT_GE(traced_counts.size(), 2u);
    EXPECT_LT(traced_counts[0], probe / 2);
    EXPECT_EQ(traced_counts[1], probe);
    EXPECT_LT(port.first_trace_seconds, kColdSeconds);
}

/// What the probe cost, and what the chosen set will cost at that rate, fit into the tenth where a set does not grow.
TEST(TrainingBudget, ProbeAndTrainingTakeATenthOfTheLimitAtMost) {
    for (const double limit : {10.0, 25.0, 60.0}) {
        TableService service;
        JobSpec timed = service.table_spec(0);
        timed.time_limit_seconds = limit;
        timed.algorithm = without(timed.algorithm, "training-paths");
        const std::string id = service.submit_training(timed);
        const std::string worker = service.add_worker();
        const auto probe = service.lease(worker);
        ASSERT_EQ(probe.size(), 1u);
        ASSERT_EQ(probe[0].unit.key.kind, UnitKind::kProbe);
        constexpr double kSeconds = 0.1;  // which give() says that the tracing took
        const double per_sample = kSeconds / double(probe[0].unit.training.sample_count);
        service.give(worker, probe[0], traced(probe[0]));
        const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.phase == PreparePhase::kTracing; });
        const double chosen = info.spec.algorithm.value("training-paths");
        const auto fits = [&](double samples) {
            return kSeconds + samples * per_sample * (1 + kLearningOverTracing) <= kTrainingShare * limit;
        };
        EXPECT_TRUE(fits(chosen)) << limit;
        EXPECT_FALSE(fits(2 * chosen)) << limit;
    }
}

/// A time-limited job whose probe will say that it can afford the smallest set only.
JobSpec poor_job(const TableService& service) {
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 0.5;  // a tenth of which is less than give() says that the probe took
    timed.algorithm = without(timed.algorithm, "training-paths");
    return timed;
}

const auto in_phase = [](PreparePhase phase) { return [phase](const JobInfo& job) { return job.phase == phase; }; };
bool is_running(const JobInfo& job) { return job.state == JobState::kRunning; }

/// Both probe; the second waits for the first's tables once its own probe has shown that both can afford the same set.
TEST(TrainingBudget, JobsThatSettleOnTheSameSetTrainOnce) {
    for (const char* first_ends : {"well", "cancelled", "failed"}) {
        TableService service;
        const std::string first = service.submit_training(poor_job(service)), second = service.submit_training(poor_job(service));
        const auto probes = lease_all(service);
        ASSERT_EQ(probes.size(), 2u);
        EXPECT_EQ(probes[0].second.job_id, first);
        EXPECT_EQ(probes[1].second.job_id, second);
        service.give(probes[0].first, probes[0].second, traced(probes[0].second));
        service.wait(first, in_phase(PreparePhase::kTracing));
        service.give(probes[1].first, probes[1].second, traced(probes[1].second));
        service.wait(second, in_phase(PreparePhase::kWaitingForTables));
        EXPECT_EQ(service.coordinator->get_job(second)->waits_for, first);
        auto held = lease_all(service);
        ASSERT_EQ(held.size(), 1u);
        EXPECT_EQ(held[0].second.job_id, first);
        const bool alone = first_ends != std::string("well");
        if (alone) {
            if (first_ends == std::string("cancelled")) {
                ASSERT_TRUE(service.coordinator->cancel_job(first).ok());
            } else {
                ASSERT_TRUE(
                    service.coordinator->release_unit(held[0].first, held[0].second.reference(), invalid_argument("boom")).ok());
                EXPECT_EQ(service.coordinator->get_job(first)->state, JobState::kFailed);
            }
            service.wait(second, in_phase(PreparePhase::kTracing));
            held = lease_all(service);
            ASSERT_EQ(held.size(), 1u);
        }
        service.give(held[0].first, held[0].second, traced(held[0].second));
        const JobInfo taken = service.wait(second, is_running);
        EXPECT_EQ(taken.tables.from_cache, !alone);
        EXPECT_TRUE(taken.tables.capped_by_time_limit);
        if (alone) continue;
        EXPECT_EQ(taken.tables.asset.digest, service.wait(first, is_running).tables.asset.digest);
    }
}

TEST(TrainingBudget, SoDoThreeOfThem) {
    TableService service;
    std::vector<std::string> jobs;
    for (int i = 0; i < 3; ++i) jobs.push_back(service.submit_training(poor_job(service)));
    const auto waits = [&](const std::string& id) {
        const JobInfo job = *service.coordinator->get_job(id);
        return !job.waits_for.empty() && uint64_t(job.spec.algorithm.value("training-paths")) == kMinTrainingSamples;
    };
    int probes = 0;
    std::vector<std::pair<std::string, UnitLease>> sets;
    for (int i = 0; i < 12000 && (sets.empty() || std::count_if(jobs.begin(), jobs.end(), waits) < 2); ++i) {
        for (const auto& [worker, lease] : lease_all(service)) {
            if (lease.unit.key.kind == UnitKind::kProbe) {
                ++probes;
                service.give(worker, lease, traced(lease));
            } else {
                sets.emplace_back(worker, lease);
            }
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(probes, 3);
    ASSERT_EQ(sets.size(), 1u);
    const std::string maker = sets[0].second.job_id;  // who settled first
    service.give(sets[0].first, sets[0].second, traced(sets[0].second));
    const Digest tables = service.wait(maker, is_running).tables.asset.digest;
    for (const std::string& id : jobs) {
        const JobInfo job = service.wait(id, is_running);
        EXPECT_EQ(job.tables.asset.digest, tables);
        EXPECT_EQ(job.tables.from_cache, id != maker);
    }
}

/// Their maker takes its time: it may be tracing for longer than the other's limit.
TEST(TrainingBudget, ATimeLimitedJobWaitsForNoTablesBeforeItKnowsWhatItCanAfford) {
    TableService service;
    JobSpec leisurely = service.table_spec(4096);
    leisurely.algorithm = without(leisurely.algorithm, "training-paths");
    const std::string maker = service.submit_training(leisurely), timed = service.submit_training(poor_job(service));
    EXPECT_EQ(service.coordinator->get_job(timed)->phase, PreparePhase::kProbing);
    // The maker's units are in work when the probe's turn comes.
    std::string worker;
    std::vector<UnitLease> leases;
    do {
        worker = service.add_worker();
        leases = service.lease(worker);
        ASSERT_EQ(leases.size(), 1u);
    } while (leases[0].job_id == maker);
    ASSERT_EQ(leases[0].job_id, timed);
    service.give(worker, leases[0], traced(leases[0]));
    const JobInfo settled = service.wait(timed, [](const JobInfo& j) { return j.phase == PreparePhase::kTracing; });
    EXPECT_EQ(settled.spec.algorithm.value("training-paths"), double(kMinTrainingSamples));
}

/// Who waits for a younger job's tables does not wait for what has come in between.
TEST(TrainingBudget, AJobThatWaitsLendsItsPlaceInTheQueue) {
    TableService service;
    const std::string old = service.submit_training(poor_job(service));
    const std::string between = service.submit_now(service.spec(1000));
    service.wait(between, is_running);
    JobSpec same = service.table_spec(1);
    same.algorithm = same.algorithm.with("training-paths", double(kMinTrainingSamples));
    const std::string young = service.submit_training(same);
    const std::string worker = service.add_worker();
    const auto probe = service.lease(worker);
    ASSERT_EQ(probe.size(), 1u);
    ASSERT_EQ(probe[0].job_id, old);
    service.give(worker, probe[0], traced(probe[0]));
    service.wait(old, [&](const JobInfo& j) { return j.waits_for == young; });
    const auto next = service.lease(worker);
    ASSERT_EQ(next.size(), 1u);
    EXPECT_EQ(next[0].job_id, young);
    service.give(worker, next[0], traced(next[0]));
    const JobInfo taken = service.wait(old, is_running), made = service.wait(young, is_running);
    EXPECT_EQ(taken.tables.asset.digest, made.tables.asset.digest);
    EXPECT_TRUE(taken.tables.capped_by_time_limit);
    EXPECT_FALSE(made.tables.capped_by_time_limit);
    EXPECT_EQ(service.lease(worker).at(0).job_id, old);
}

TEST(TrainingBudget, ATimeLimitedJobRecordsWhatItTrainedAndCanBeRenderedAgain) {
    TableService service([](CoordinatorOptions& o) { o.clock = [] { return std::chrono::steady_clock::now(); }; });
    LightCrew crew(golden());
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity);
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 0.5;
    timed.algorithm = without(timed.algorithm, "training-paths");
    const JobInfo info = service.wait_end(service.submit_now(timed));
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_TRUE(info.tables.capped_by_time_limit);
    EXPECT_LT(info.tables.training_samples, 200000u);
    EXPECT_EQ(info.spec.algorithm.value("training-paths"), double(info.tables.training_samples));
    JobSpec again = service.table_spec(uint32_t(info.samples_per_pixel_done));
    again.algorithm = again.algorithm.with("training-paths", double(info.tables.training_samples));
    const JobInfo repeated = service.wait_end(service.submit_now(again));
    EXPECT_EQ(repeated.image_digest, info.image_digest);
    EXPECT_EQ(repeated.tables.asset.digest, info.tables.asset.digest);
    const std::string manifest = *service.coordinator->manifest(info.job_id);
    for (const char* key :
         {"\"training_samples\"", "\"held_out_loss\"", "\"trace\"", "\"gamma\"", "\"capped_by_time_limit\": true"})
        EXPECT_NE(manifest.find(key), std::string::npos) << key;
    EXPECT_NE(manifest.find(info.tables.asset.digest.hex()), std::string::npos);
    // Who names the training set gets it, whatever the time limit.
    timed.algorithm = timed.algorithm.with("training-paths", 3000);
    const JobInfo chosen = service.wait_end(service.submit_now(timed));
    EXPECT_EQ(chosen.tables.training_samples, 3000u);
    EXPECT_FALSE(chosen.tables.capped_by_time_limit);
}

}  // namespace
}  // namespace lightloom
