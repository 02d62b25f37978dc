// Tables through the service: training units taken in exactly once, the cache, the broadcast, and what happens when parts of it
// break. Real light, in a scene of a few triangles.

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/film/atomic_file.h"
#include "common/transport/training.h"
#include "common/work/identity.h"
#include "server/grpc_services.h"
#include "server/results.h"
#include "server/scene_reader.h"
#include "server/training_budget.h"
#include "tests/service/fake.h"
#include "worker/grpc_worker_port.h"
#include "worker/scene_cache.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::TempDirectory;

const FrameLayout kFrame{32, 32, {0, 0, 32, 32}};
constexpr uint64_t kSamples = 3 * kTrainingUnitSamples - 5000;

std::shared_ptr<const Scene> golden() {
    static const std::shared_ptr<const Scene> scene = std::move(Scene::build(golden_scene())).value();
    return scene;
}

SceneFacts golden_facts() {
    return {kFrame, 1, 5, {}, [] { return Result<std::shared_ptr<const Scene>>(golden()); }};
}

/// A service that makes tables of the golden scene.
struct TableService : FakeService {
    explicit TableService(const std::function<void(CoordinatorOptions&)>& change = {}, std::optional<uint64_t> shuffle = std::nullopt)
        : FakeService(kFrame, shuffle, [&](CoordinatorOptions& options) {
              options.read_scene = [](const AssetStore&, const JobSpec&, std::stop_token) { return Result<SceneFacts>(golden_facts()); };
              if (change) change(options);
          }) {}
    JobSpec table_spec(uint32_t spp = 2) const {
        JobSpec s = spec(spp);
        s.algorithm = "spcbpt";
        s.parameters = {{"training-paths", std::to_string(kSamples)}, {"cache", "500"}, {"light-subspaces", "40"}, {"eye-subspaces", "20"}};
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
    SubmitAck give(const std::string& worker, const UnitLease& lease, const std::string& payload, const Digest& digest) {
        const auto ack = coordinator->submit_training(worker, lease.reference(), digest, payload, 0.1);
        EXPECT_TRUE(ack.ok()) << ack.status().message();
        return ack.ok() ? *ack : SubmitAck{SubmitOutcome::kRejected, "error"};
    }
    SubmitAck give(const std::string& worker, const UnitLease& lease, const std::string& payload) {
        return give(worker, lease, payload, sha256(payload));
    }
};

/// What a worker makes of a training unit; remembered, because many tests trace the same ones.
const std::string& traced(const UnitLease& lease) {
    static std::map<std::tuple<Digest, uint64_t, uint64_t>, std::string> memory;
    const TrainingWork& work = lease.unit.training;
    std::string& payload = memory[{lease.spec.image_digest(), work.first_sample, work.total_samples}];
    if (payload.empty()) payload = serialize(*trace_training(*golden(), render_settings(lease.spec), work, {}));
    return payload;
}

/// All training units of the running phase, in the hands of as many workers as it takes.
std::vector<std::pair<std::string, UnitLease>> lease_all(TableService& service) {
    std::vector<std::pair<std::string, UnitLease>> held;
    for (;;) {
        const std::string worker = service.add_worker();
        const auto leases = service.lease(worker);
        if (leases.empty()) return held;
        held.emplace_back(worker, leases[0]);
    }
}

Digest tables_alone(const JobSpec& spec) {
    JobSpec whole = spec;
    whole.max_depth = 5;
    TrainingReport report;
    return sha256(serialize(*make_tables(*golden(), render_settings(whole), {}, &report)));
}

/// Submits and delivers all training units, in order; the job then renders.
std::string train_by_hand(TableService& service, const JobSpec& spec) {
    const std::string id = service.submit_training(spec);
    for (const auto& [worker, lease] : lease_all(service)) EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    return id;
}

TEST(Tables, TrainingUnitsCountOnceInAnyOrderAndMakeTheTablesOfASingleMachine) {
    for (const bool turned : {false, true}) {
        TableService service({}, turned ? std::optional<uint64_t>(5) : std::nullopt);
        const std::string id = service.submit_training(service.table_spec());
        JobInfo info = *service.coordinator->get_job(id);
        EXPECT_EQ(info.state, JobState::kPreparing);
        EXPECT_EQ(info.phase, PreparePhase::kTracing);
        EXPECT_EQ(info.phase_total, kSamples);
        auto held = lease_all(service);
        ASSERT_EQ(held.size(), 3u);
        if (turned) std::reverse(held.begin(), held.end());
        for (size_t i = 0; i + 1 < held.size(); ++i) {
            const auto& [worker, lease] = held[i];
            EXPECT_EQ(lease.unit.key.kind, UnitKind::kTraining);
            EXPECT_EQ(lease.tables.size_bytes, 0u);
            EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
            EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kDuplicateSame);
        }
        EXPECT_GT(service.coordinator->get_job(id)->phase_done, 0u);
        EXPECT_EQ(service.give(held[2].first, held[2].second, traced(held[2].second)).outcome, SubmitOutcome::kAccepted);
        info = service.wait(id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
        EXPECT_EQ(info.tables.asset.digest, tables_alone(info.spec));
        EXPECT_EQ(info.tables.training_samples, kSamples);
        EXPECT_FALSE(info.tables.from_cache);
        EXPECT_EQ(info.duplicates_same, 2u);
        EXPECT_EQ(service.give(held[0].first, held[0].second, traced(held[0].second)).outcome, SubmitOutcome::kStale);
        const auto render = service.lease(service.add_worker());
        ASSERT_EQ(render.size(), 1u);
        EXPECT_EQ(render[0].unit.key.kind, UnitKind::kRender);
        EXPECT_EQ(render[0].tables.digest, info.tables.asset.digest);
        EXPECT_TRUE(service.coordinator->assets().read(info.tables.asset.digest).ok());
    }
}

TEST(Tables, TrainingUnitsOfSilentWorkersGoToOthers) {
    TableService service;
    const std::string id = service.submit_training(service.table_spec());
    const auto lost = lease_all(service);
    ASSERT_EQ(lost.size(), 3u);
    EXPECT_TRUE(service.lease(service.add_worker()).empty());
    ASSERT_TRUE(service.coordinator->heartbeat(lost[0].first, {{lost[0].second.reference(), true}}).ok());
    service.now_ms += 11000;
    service.wait(id, [](const JobInfo& j) { return j.unit_leased == 0; });
    ASSERT_TRUE(service.coordinator->goodbye(lost[1].first).ok());
    for (const auto& [worker, lease] : lease_all(service)) EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    EXPECT_EQ(info.tables.asset.digest, tables_alone(info.spec));
    EXPECT_EQ(info.render_seconds, 0) << "tracing is no rendering: the time limit has not begun";
}

TEST(Tables, DamagedTrainingDataAreRefusedAndTheUnitIsLeasedAgain) {
    TableService service;
    const std::string id = service.submit_training(service.table_spec());
    auto held = lease_all(service);
    ASSERT_EQ(held.size(), 3u);
    const auto& [worker, lease] = held[0];
    std::string damaged = traced(lease);
    damaged[damaged.size() / 2] ^= 1;
    EXPECT_EQ(service.give(worker, lease, damaged, sha256(traced(lease))).outcome, SubmitOutcome::kRejected);
    EXPECT_EQ(service.give(worker, held[1].second, traced(held[2].second)).outcome, SubmitOutcome::kRejected) << "of another size";
    EXPECT_EQ(service.give(worker, lease, "nonsense").outcome, SubmitOutcome::kRejected);
    // A light that the scene does not have shows once the scene is built.
    TrainingData data = *parse_training_data(traced(lease));
    data.vertices[data.paths[0].first_vertex].emitter = 1000000;
    EXPECT_EQ(service.give(worker, lease, serialize(data)).outcome, SubmitOutcome::kAccepted);
    for (size_t i = 1; i < 3; ++i) EXPECT_EQ(service.give(held[i].first, held[i].second, traced(held[i].second)).outcome, SubmitOutcome::kAccepted);
    std::vector<UnitLease> again;
    for (int i = 0; i < 500 && again.empty(); ++i) {
        again = service.lease(service.add_worker());
        if (again.empty()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(again[0].unit.key, lease.unit.key);
    EXPECT_EQ(service.give(worker, again[0], traced(again[0])).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    EXPECT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.tables.asset.digest, tables_alone(info.spec));
}

TEST(Tables, TrainingDataHaveABound) {
    TableService service([](CoordinatorOptions& o) { o.training_bytes = 1 << 20; });
    const std::string id = service.submit_training(service.table_spec());
    const auto held = lease_all(service);
    ASSERT_FALSE(held.empty());
    const auto limit = service.coordinator->expected_training_bytes(held[0].second.reference());
    ASSERT_TRUE(limit.ok());
    EXPECT_GE(*limit, traced(held[0].second).size());
    EXPECT_EQ(service.give(held[0].first, held[0].second, traced(held[0].second)).outcome, SubmitOutcome::kRejected);
    EXPECT_NE(service.wait_end(id).message.find("training-paths"), std::string::npos);
}

TEST(Tables, JobsCanBeCancelledInEveryPhase) {
    std::atomic<bool> reading{false}, go{false};
    TableService service([&](CoordinatorOptions& o) {
        o.read_scene = [&](const AssetStore&, const JobSpec&, std::stop_token stop) -> Result<SceneFacts> {
            reading = true;
            while (!go && !stop.stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            return golden_facts();
        };
    });
    const auto cancel = [&](const std::string& id) {
        EXPECT_EQ(service.coordinator->cancel_job(id)->state, JobState::kCancelled);
        EXPECT_TRUE(service.lease(service.add_worker()).empty());
    };
    const std::string first = service.submit_now(service.table_spec());
    while (!reading) std::this_thread::yield();
    cancel(first);
    go = true;
    cancel(service.submit_training(service.table_spec()));
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 100;
    timed.parameters.erase("training-paths");
    const std::string probing = service.submit_training(timed);
    EXPECT_EQ(service.coordinator->get_job(probing)->phase, PreparePhase::kProbing);
    const auto probe = lease_all(service);
    ASSERT_EQ(probe.size(), 1u);
    EXPECT_EQ(probe[0].second.unit.key.kind, UnitKind::kProbe);
    cancel(probing);
    EXPECT_EQ(service.coordinator->heartbeat(probe[0].first, {{probe[0].second.reference(), true}})->size(), 1u);
    EXPECT_EQ(service.give(probe[0].first, probe[0].second, traced(probe[0].second)).outcome, SubmitOutcome::kStale);
    const std::string learning = service.submit_training(service.table_spec());
    for (const auto& [worker, lease] : lease_all(service)) service.give(worker, lease, traced(lease));
    cancel(learning);
    cancel(train_by_hand(service, service.table_spec()));
    const std::string last = train_by_hand(service, service.table_spec());
    EXPECT_EQ(service.coordinator->get_job(last)->state, JobState::kRunning) << "the service goes on";
}

TEST(TableCache, ASecondJobStartsAtOnceAndAChangedOneDoesNot) {
    TempDirectory cache;
    const auto with_cache = [&](CoordinatorOptions& o) { o.table_cache = cache.path; };
    TableService first(with_cache);
    const JobInfo made = *first.coordinator->get_job(train_by_hand(first, first.table_spec()));
    ASSERT_EQ(made.state, JobState::kRunning);
    TableService second(with_cache);
    const JobInfo info = *second.coordinator->get_job(second.submit(second.table_spec(7)));
    EXPECT_EQ(info.state, JobState::kRunning);
    EXPECT_TRUE(info.tables.from_cache);
    EXPECT_EQ(info.tables.asset.digest, made.tables.asset.digest);
    EXPECT_EQ(info.tables.training_samples, kSamples);
    EXPECT_EQ(info.tables.loss, made.tables.loss);
    EXPECT_EQ(second.lease(second.add_worker()).at(0).tables.digest, made.tables.asset.digest);
    JobSpec other = second.table_spec();
    other.seed = 1;
    EXPECT_EQ(second.coordinator->get_job(second.submit_training(other))->phase, PreparePhase::kTracing);
}

TEST(TableCache, EachPartOfTheKeyMatters) {
    BuildIdentity identity{"build", "profile", sha256("golden")};
    JobSpec spec;
    spec.algorithm = "spcbpt";
    spec.parameters = complete_parameters(**find_algorithm("spcbpt"), *parse_parameters(**find_algorithm("spcbpt"), {}));
    spec.max_depth = 5;
    spec.scene_root = sha256("scene");
    spec.frame = kFrame;
    const Digest reference = table_key(identity, spec);
    std::set<Digest> keys{reference};
    const auto changed = [&](const auto& change) {
        BuildIdentity i = identity;
        JobSpec s = spec;
        change(i, s);
        EXPECT_TRUE(keys.insert(table_key(i, s)).second);
    };
    changed([](BuildIdentity& i, JobSpec&) { i.build_id += "x"; });
    changed([](BuildIdentity& i, JobSpec&) { i.math_profile += "x"; });
    changed([](BuildIdentity&, JobSpec& s) { s.algorithm = "lvcbpt"; });
    changed([](BuildIdentity&, JobSpec& s) { s.seed = 1; });
    changed([](BuildIdentity&, JobSpec& s) { s.max_depth = 6; });
    changed([](BuildIdentity&, JobSpec& s) { s.scene_root = sha256("other"); });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.width; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.height; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.crop.x0; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.crop.y0; });
    changed([](BuildIdentity&, JobSpec& s) { --s.frame.crop.x1; });
    changed([](BuildIdentity&, JobSpec& s) { --s.frame.crop.y1; });
    for (const auto& [name, value] : spec.parameters)
        changed([&](BuildIdentity&, JobSpec& s) { s.parameters[name] = value + "1"; });
    // What decides only how long the rendering takes does not.
    spec.samples_per_pixel = 9;
    EXPECT_EQ(table_key(identity, spec), reference);
}

TEST(TableCache, DamagedEntriesAreRemovedAndTheDirectoryStaysBounded) {
    const TempDirectory directory;
    const std::string bytes = serialize(trivial_tables(golden()->emitters()));
    const TableCache cache(directory.path, 5 * bytes.size() / 2 + 4096);
    const Digest key = sha256("a");
    EXPECT_FALSE(cache.find(key));
    cache.store(key, bytes, {.training_samples = 7, .loss = 0.25, .note = "a note"});
    const auto entry = cache.find(key);
    ASSERT_TRUE(entry);
    EXPECT_EQ(entry->bytes, bytes);
    EXPECT_EQ(entry->info.training_samples, 7u);
    EXPECT_EQ(entry->info.loss, 0.25);
    EXPECT_EQ(entry->info.note, "a note");
    EXPECT_EQ(*tables_of_file(*read_file(cache.path_of(key).string())), bytes);
    EXPECT_EQ(*tables_of_file(bytes), bytes);
    const std::string file = *read_file(cache.path_of(key).string());
    for (const size_t at : {size_t(3), size_t(40), size_t(150), file.size() / 2, file.size() - 1}) {
        std::string damaged = file;
        damaged[at] ^= 4;
        ASSERT_TRUE(write_file_atomically(cache.path_of(key).string(), damaged).ok());
        EXPECT_FALSE(cache.find(key)) << at;
        EXPECT_FALSE(std::filesystem::exists(cache.path_of(key))) << at;
    }
    // Another key's entry under this name is no entry of this key.
    ASSERT_TRUE(write_file_atomically(cache.path_of(sha256("b")).string(), file).ok());
    EXPECT_FALSE(cache.find(sha256("b")));
    for (int i = 0; i < 40; ++i) cache.store(sha256(std::to_string(i)), bytes, {});
    uint64_t total = 0;
    for (const auto& item : std::filesystem::directory_iterator(directory.path)) total += item.file_size();
    EXPECT_LE(total, 5 * bytes.size() / 2 + 4096);
    EXPECT_TRUE(cache.find(sha256("39"))) << "the newest entry stays";
    EXPECT_FALSE(TableCache({}, 1000).find(key));
}

/// Bytes that arrive damaged, the first few times.
class NoisyPort final : public WorkerPort {
  public:
    NoisyPort(WorkerPort& port, int damaged_reads) : port_(port), damaged_(damaged_reads) {}
    Result<WorkerGrant> register_worker(const WorkerHello& hello) override { return port_.register_worker(hello); }
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) override {
        return port_.lease_units(worker_id, wait_seconds, stop);
    }
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) override {
        return port_.heartbeat(worker_id, running);
    }
    Result<SubmitAck> submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial, double seconds) override {
        return port_.submit_result(worker_id, lease, std::move(partial), seconds);
    }
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload, double seconds) override {
        return port_.submit_training(worker_id, lease, payload, seconds);
    }
    Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) override {
        return port_.release_unit(worker_id, unit, why);
    }
    Status goodbye(const std::string& worker_id) override { return port_.goodbye(worker_id); }
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

  private:
    WorkerPort& port_;
    std::atomic<int> damaged_;
};

TEST(Broadcast, DamagedTablesAreFetchedAgain) {
    TableService service;
    LocalWorkerPort local(*service.coordinator);
    const std::string bytes = serialize(trivial_tables(golden()->emitters()));
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
    const std::filesystem::path file = AssetStore(directory.path / "assets").path_of(asset.digest);
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

/// Workers with real light, all in this process.
class LightCrew {
  public:
    void add(std::unique_ptr<WorkerPort> port, const BuildIdentity& identity, bool tables = true) {
        ports_.push_back(std::move(port));
        WorkerPort& p = *ports_.back();
        const TableSource source = tables ? direct_tables(p) : [](const AssetReference&, std::stop_token) -> Result<std::string> {
            return data_loss("the disk is broken");
        };
        caches_.push_back(std::make_unique<RendererCache>(
            [](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(golden()); }, source));
        RendererCache& cache = *caches_.back();
        workers_.push_back(std::make_unique<Worker>(
            p, WorkerOptions{.identity = identity, .thread_count = 1, .host = "h", .process_id = workers_.size()},
            [&](const UnitLease& lease, std::stop_token stop) { return cache.renderer(lease, stop); },
            [&](const JobSpec& spec, std::stop_token stop) { return cache.tracer(spec, stop); }));
        threads_.emplace_back([w = workers_.back().get()](std::stop_token stop) { EXPECT_TRUE(w->run(stop).ok()); });
    }
    ~LightCrew() {
        for (std::jthread& t : threads_) t.request_stop();
    }

  private:
    std::vector<std::unique_ptr<WorkerPort>> ports_;
    std::vector<std::unique_ptr<RendererCache>> caches_;
    std::vector<std::unique_ptr<Worker>> workers_;
    std::vector<std::jthread> threads_;
};

JobInfo run(int workers, bool over_grpc, const std::function<JobSpec(const TableService&)>& spec) {
    TableService service({}, workers);
    std::unique_ptr<GrpcServer> server;
    if (over_grpc) server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    LightCrew crew;
    const auto add = [&] {
        if (over_grpc) {
            crew.add(std::make_unique<GrpcWorkerPort>(grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()),
                                                                          grpc::InsecureChannelCredentials())), service.identity);
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
    for (const char* algorithm : {"spcbpt", "lvcbpt"}) {
        const auto spec = [&](const TableService& service) {
            JobSpec s = service.table_spec(6);
            s.algorithm = algorithm;
            if (s.algorithm == "lvcbpt") s.parameters = {{"training-paths", "20000"}, {"cache", "500"}};
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
    LightCrew crew;
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity, false);
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
        RendererCache cache([](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(golden()); },
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
    for (const bool copy : {true, false}) {
        TempDirectory cache;
        TableService service([&](CoordinatorOptions& o) {
            if (copy) o.table_cache = cache.path;
        });
        const std::string id = train_by_hand(service, service.table_spec(2));
        const AssetReference asset = service.coordinator->get_job(id)->tables.asset;
        std::string bytes = *service.coordinator->assets().read(asset.digest);
        bytes[bytes.size() / 2] ^= 1;
        ASSERT_TRUE(write_file_atomically(service.coordinator->assets().path_of(asset.digest).string(), bytes).ok());
        LightCrew crew;
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

TEST(TrainingBudget, ATimeLimitedJobRecordsWhatItTrainedAndCanBeRenderedAgain) {
    TableService service([](CoordinatorOptions& o) { o.clock = [] { return std::chrono::steady_clock::now(); }; });
    LightCrew crew;
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity);
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 0.5;
    timed.parameters.erase("training-paths");
    const JobInfo info = service.wait_end(service.submit_now(timed));
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_TRUE(info.tables.capped_by_time_limit);
    EXPECT_LT(info.tables.training_samples, 200000u);
    EXPECT_EQ(info.spec.parameters.at("training-paths"), std::to_string(info.tables.training_samples));
    JobSpec again = service.table_spec(uint32_t(info.samples_per_pixel_done));
    again.parameters["training-paths"] = std::to_string(info.tables.training_samples);
    const JobInfo repeated = service.wait_end(service.submit_now(again));
    EXPECT_EQ(repeated.image_digest, info.image_digest);
    EXPECT_EQ(repeated.tables.asset.digest, info.tables.asset.digest);
    const std::string manifest = *service.coordinator->manifest(info.job_id);
    for (const char* key : {"\"training_samples\"", "\"held_out_loss\"", "\"trace\"", "\"gamma\"", "\"capped_by_time_limit\": true"})
        EXPECT_NE(manifest.find(key), std::string::npos) << key;
    EXPECT_NE(manifest.find(info.tables.asset.digest.hex()), std::string::npos);
    // Who names the training set gets it, whatever the time limit.
    timed.parameters["training-paths"] = "3000";
    const JobInfo chosen = service.wait_end(service.submit_now(timed));
    EXPECT_EQ(chosen.tables.training_samples, 3000u);
    EXPECT_FALSE(chosen.tables.capped_by_time_limit);
}

}  // namespace
}  // namespace lightloom
