// Training through the service: units taken in exactly once, whoever traces them, and the cache of what was learned.

#include "tests/service/table_service.h"

namespace lightloom {
namespace {

using namespace lightloom::testing;

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
    for (const auto& [worker, lease] : lease_all(service))
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    EXPECT_EQ(info.tables.asset.digest, tables_alone(info.spec));
    EXPECT_EQ(info.render_seconds, 0) << "tracing is no rendering: the time limit has not begun";
}

TEST(Tables, DamagedTrainingDataAreRefusedAndTheUnitIsLeasedAgain) {
    uint64_t bytes = 0;
    {
        TableService measured;
        measured.submit_training(measured.table_spec());
        for (const auto& [worker, lease] : lease_all(measured)) bytes += traced(lease).size();
    }
    // Room for every unit once: what is thrown away must not count.
    TableService service([&](CoordinatorOptions& o) { o.training_bytes = bytes + 1000; });
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
    data.paths[0].emitter = 1000000;
    EXPECT_EQ(service.give(worker, lease, serialize(data)).outcome, SubmitOutcome::kAccepted);
    for (size_t i = 1; i < 3; ++i)
        EXPECT_EQ(service.give(held[i].first, held[i].second, traced(held[i].second)).outcome, SubmitOutcome::kAccepted);
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
    TableService plenty;
    JobSpec spec = plenty.table_spec();
    spec.algorithm = spec.algorithm.with("energy-paths", 16);
    plenty.submit_training(spec);
    const auto large = lease_all(plenty);
    ASSERT_FALSE(large.empty());
    const std::string most = traced(large[0].second);
    EXPECT_GT(most.size(), 3 * traced(held[0].second).size());
    EXPECT_EQ(plenty.give(large[0].first, large[0].second, most).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.give(held[0].first, held[0].second, traced(held[0].second)).outcome, SubmitOutcome::kRejected);
    EXPECT_NE(service.wait_end(id).message.find("training-paths"), std::string::npos);
}

/// Of a few samples, sums by block and visits are nearly all of the data. Data without what was asked for belong to no unit.
TEST(Tables, DataOfVisitsFitTheirBound) {
    for (const bool damaged : {true, false}) {
        TableService service;
        JobSpec spec = service.table_spec();
        spec.algorithm = testing::algorithm_of("path", {{"roulette", "learned"}, {"training-paths", "4"}});
        service.submit_training(spec);
        const auto held = lease_all(service);
        ASSERT_EQ(held.size(), 1u);
        std::string bytes = traced(held[0].second);
        auto data = parse_training_data(bytes);
        ASSERT_TRUE(data.ok());
        EXPECT_FALSE(data->visits.empty());
        EXPECT_TRUE(data->paths.empty());
        if (damaged) {
            data->block_square.clear();
            bytes = serialize(*data);
        }
        EXPECT_EQ(service.give(held[0].first, held[0].second, bytes).outcome,
                  damaged ? SubmitOutcome::kRejected : SubmitOutcome::kAccepted);
    }
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
    timed.algorithm = without(timed.algorithm, "training-paths");
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

JobInfo wait_waiting(TableService& service, const std::string& id) {
    return service.wait(id, [](const JobInfo& j) { return j.phase == PreparePhase::kWaitingForTables; });
}

TEST(Tables, AnEqualJobWaitsForThemInsteadOfTrainingToo) {
    TableService service;
    const std::string first = service.submit_training(service.table_spec(2)), second = service.submit_now(service.table_spec(7));
    const JobInfo waiting = wait_waiting(service, second);
    EXPECT_EQ(waiting.waits_for, first);
    EXPECT_EQ(phase_text(waiting), "waiting for the tables of " + first);
    const auto held = lease_all(service);
    EXPECT_EQ(held.size(), 3u) << "of the first only";
    for (const auto& [worker, lease] : held) {
        EXPECT_EQ(lease.job_id, first);
        const uint64_t before = service.coordinator->get_job(second)->revision;
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
        EXPECT_GT(service.coordinator->get_job(second)->revision, before) << "who watches it sees how far the other is";
    }
    const auto running = [](const JobInfo& j) { return j.state == JobState::kRunning; };
    const JobInfo made = service.wait(first, running), taken = service.wait(second, running);
    EXPECT_FALSE(made.tables.from_cache);
    EXPECT_TRUE(taken.tables.from_cache);
    EXPECT_EQ(taken.waits_for, "");
    EXPECT_EQ(taken.tables.asset.digest, made.tables.asset.digest);
    EXPECT_EQ(taken.spec.samples_per_pixel, 7u);
    JobSpec other = service.table_spec(2);
    other.seed = 9;
    EXPECT_EQ(service.coordinator->get_job(service.submit_training(other))->phase, PreparePhase::kTracing);
}

TEST(Tables, AJobThatWaitedMakesThemItselfWhenTheOtherEnds) {
    for (const bool fails : {false, true}) {
        TableService service;
        const std::string first = service.submit_training(service.table_spec(2));
        const std::string second = service.submit_now(service.table_spec(2));
        const std::string third = service.submit_now(service.table_spec(2));
        wait_waiting(service, second);
        wait_waiting(service, third);
        if (fails) {
            const std::string worker = service.add_worker();
            const UnitLease lease = service.lease(worker).at(0);
            ASSERT_TRUE(service.coordinator->release_unit(worker, lease.reference(), invalid_argument("boom")).ok());
            EXPECT_EQ(service.coordinator->get_job(first)->state, JobState::kFailed);
        } else {
            ASSERT_TRUE(service.coordinator->cancel_job(first).ok());
        }
        // Of the two that waited, one goes on and the other waits for it.
        std::string maker;
        for (int i = 0; i < 1000 && maker.empty(); ++i) {
            for (const std::string& id : {second, third})
                if (service.coordinator->get_job(id)->phase == PreparePhase::kTracing) maker = id;
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
        ASSERT_FALSE(maker.empty());
        const std::string other = maker == second ? third : second;
        service.wait(other, [&](const JobInfo& j) { return j.waits_for == maker; });
        for (const auto& [worker, lease] : lease_all(service)) {
            EXPECT_EQ(lease.job_id, maker);
            EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
        }
        const auto running = [](const JobInfo& j) { return j.state == JobState::kRunning; };
        EXPECT_EQ(service.wait(maker, running).tables.asset.digest, service.wait(other, running).tables.asset.digest);
    }
}

TEST(Tables, TheirBytesGoWithTheLastJobThatNamesThem) {
    TableService service;
    const std::string first = service.submit_training(service.table_spec(2)), second = service.submit_now(service.table_spec(3));
    wait_waiting(service, second);
    for (const auto& [worker, lease] : lease_all(service)) service.give(worker, lease, traced(lease));
    const auto running = [](const JobInfo& j) { return j.state == JobState::kRunning; };
    const Digest digest = service.wait(first, running).tables.asset.digest;
    ASSERT_TRUE(service.coordinator->cancel_job(first).ok());
    service.wait(second, running);
    EXPECT_TRUE(service.coordinator->assets().contains(digest));
    ASSERT_TRUE(service.coordinator->cancel_job(second).ok());
    EXPECT_FALSE(service.coordinator->assets().contains(digest));
    // What a coordinator that was killed left behind goes when the next one starts; files of scenes stay.
    const Digest left = sha256(serialize(Tables(trivial_tables(golden()->emitters()))));
    ASSERT_TRUE(service.coordinator->assets().put(left, serialize(Tables(trivial_tables(golden()->emitters())))).ok());
    CoordinatorOptions options;
    options.directory = service.directory.path;
    service.coordinator.reset();
    Coordinator next(options);
    EXPECT_FALSE(next.assets().contains(left));
    EXPECT_TRUE(next.assets().contains(service.root));
}

/// What the cached tables of these tests consist of.
constexpr const TablePart* kParts[] = {&SubspaceTables::kPart};

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
    spec.algorithm = algorithm_of("spcbpt");
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
    changed([](BuildIdentity& i, JobSpec&) { i.golden_digest = sha256("other"); });
    changed([](BuildIdentity&, JobSpec& s) { s.algorithm = algorithm_of("lvcbpt"); });
    changed([](BuildIdentity&, JobSpec& s) { s.seed = 1; });
    changed([](BuildIdentity&, JobSpec& s) { s.max_depth = 6; });
    changed([](BuildIdentity&, JobSpec& s) { s.scene_root = sha256("other"); });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.width; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.height; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.crop.x0; });
    changed([](BuildIdentity&, JobSpec& s) { ++s.frame.crop.y0; });
    changed([](BuildIdentity&, JobSpec& s) { --s.frame.crop.x1; });
    changed([](BuildIdentity&, JobSpec& s) { --s.frame.crop.y1; });
    for (const ParameterInfo& p : spec.algorithm.info().parameters)
        changed([&](BuildIdentity&, JobSpec& s) {
            s.algorithm = s.algorithm.with(p.name, p.default_value == p.max_value ? p.min_value : p.max_value);
        });
    // What decides only how long the rendering takes does not.
    spec.samples_per_pixel = 9;
    EXPECT_EQ(table_key(identity, spec), reference);
}

TEST(TableCache, DamagedEntriesAreRemovedAndTheDirectoryStaysBounded) {
    const TempDirectory directory;
    const std::string bytes = serialize(Tables(trivial_tables(golden()->emitters())));
    const TableCache cache(directory.path, 5 * bytes.size() / 2 + 4096);
    const Digest key = sha256("a");
    EXPECT_FALSE(cache.find(key, kParts));
    cache.store(key, bytes, {.training_samples = 7, .loss = 0.25, .note = "a note"});
    const auto entry = cache.find(key, kParts);
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
        EXPECT_FALSE(cache.find(key, kParts)) << at;
        EXPECT_FALSE(std::filesystem::exists(cache.path_of(key))) << at;
    }
    // Another key's entry under this name is no entry of this key.
    ASSERT_TRUE(write_file_atomically(cache.path_of(sha256("b")).string(), file).ok());
    EXPECT_FALSE(cache.find(sha256("b"), kParts));
    for (int i = 0; i < 40; ++i) cache.store(sha256(std::to_string(i)), bytes, {});
    uint64_t total = 0;
    for (const auto& item : std::filesystem::directory_iterator(directory.path)) total += item.file_size();
    EXPECT_LE(total, 5 * bytes.size() / 2 + 4096);
    EXPECT_TRUE(cache.find(sha256("39"), kParts)) << "the newest entry stays";
    EXPECT_FALSE(TableCache({}, 1000).find(key, kParts));
}

TEST(TableCache, WhatAKilledProcessBeganIsRemoved) {
    const TempDirectory directory;
    const std::string bytes = serialize(Tables(trivial_tables(golden()->emitters())));
    const TableCache cache(directory.path, 1 << 20);
    const auto path = [&](const std::string& name) { return directory.path / name; };
    const std::string entry = sha256("a").hex() + ".tables", old = entry + ".tmp-1-0", young = entry + ".tmp-2-0";
    for (const std::string& name : {old, young, std::string("notes.txt")}) {
        std::ofstream(path(name)) << "x";
        if (name == young) continue;
        std::filesystem::last_write_time(path(name), std::filesystem::file_time_type::clock::now() - std::chrono::hours(2));
    }
    cache.store(sha256("b"), bytes, {});
    EXPECT_FALSE(std::filesystem::exists(path(old)));
    EXPECT_TRUE(std::filesystem::exists(path(young))) << "somebody may be writing it";
    EXPECT_TRUE(std::filesystem::exists(path("notes.txt"))) << "which is none of ours";
    EXPECT_TRUE(cache.find(sha256("b"), kParts));
}

TEST(TableCache, AMalformedReportIsADamagedEntry) {
    const TempDirectory directory;
    const std::string bytes = serialize(Tables(trivial_tables(golden()->emitters())));
    const TableCache cache(directory.path, 1 << 20);
    const Digest key = sha256("a");
    cache.store(key, bytes, {.loss = std::numeric_limits<double>::infinity()});
    EXPECT_TRUE(cache.find(key, kParts)) << "no report that we write ourselves is damaged";
    const std::string file = *read_file(cache.path_of(key).string());
    const size_t head = file.find('\n') + 1, begin = file.find('\n', head) + 1, end = file.find('\n', begin);
    const std::string good = file.substr(begin, end - begin);
    const auto find_with = [&](const std::string& report) {
        const std::string rest = file.substr(head, begin - head) + report + file.substr(end);
        const std::string whole = file.substr(0, head - 65) + sha256(rest).hex() + "\n" + rest;
        EXPECT_TRUE(write_file_atomically(cache.path_of(key).string(), whole).ok());
        return cache.find(key, kParts).has_value();
    };
    EXPECT_TRUE(find_with(good));
    const auto with = [&](const std::string& field, const std::string& value) {
        const size_t at = good.find("\"" + field + "\":") + field.size() + 3;
        return good.substr(0, at) + value + good.substr(good.find_first_of(",}", at));
    };
    EXPECT_TRUE(find_with(with("loss", "1.5")));
    for (const std::string& report :
         {std::string("null"), std::string("[]"), std::string("{}"), std::string("7"), std::string(), std::string("{\"loss\":"),
          with("loss", "null"), with("loss", "\"1\""), with("note", "null"), with("note", "5"), with("training_samples", "-1"),
          with("light_subspaces", "4294967296"), with("eye_subspaces", "1.5"), with("capped_by_time_limit", "0")}) {
        EXPECT_FALSE(find_with(report)) << report;
        EXPECT_FALSE(std::filesystem::exists(cache.path_of(key))) << report;
    }
}

TEST(Tables, TooLittleMemoryFailsTheJobAndNothingElse) {
    TableService service([](CoordinatorOptions& o) {
        o.read_scene = [](const AssetStore&, const JobSpec& spec, std::stop_token) -> Result<SceneFacts> {
            if (spec.seed == 1) throw std::bad_alloc();
            SceneFacts facts = golden_facts();
            facts.build_scene = [seed = spec.seed, build = facts.build_scene] {
                if (seed == 2) throw std::length_error("vector");
                if (seed == 3) throw std::bad_alloc();
                return build();
            };
            return facts;
        };
    });
    for (const uint64_t seed : {1, 2, 3}) {
        JobSpec spec = service.table_spec();
        spec.seed = seed;
        const std::string id = service.submit_training(spec);
        lease_all(service);
        const JobInfo info = service.wait_end(id);
        EXPECT_EQ(info.state, JobState::kFailed);
        EXPECT_NE(info.message.find("the coordinator has too little memory to " + std::string(seed == 1 ? "prepare" : "learn")),
                  std::string::npos)
            << info.message;
    }
    EXPECT_EQ(service.coordinator->get_job(train_by_hand(service, service.table_spec()))->state, JobState::kRunning);
}

}  // namespace
}  // namespace lightloom
