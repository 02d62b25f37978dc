// Training in two rounds: a pilot, whose tables go out as those of a render do, and the round that they guide.

#include "tests/service/table_service.h"

namespace lightloom::testing {
namespace {

/// Delivers the pilot of a job, as if it had taken `milliseconds`, and takes all units of the round that it guides.
std::vector<std::pair<std::string, UnitLease>> deliver_pilot(TableService& service, int milliseconds = 0) {
    const auto pilot = lease_all(service);
    service.now_ms += milliseconds;
    EXPECT_EQ(pilot.size(), 1u);
    for (const auto& [worker, lease] : pilot) {
        EXPECT_EQ(lease.unit.key.kind, UnitKind::kTraining);
        EXPECT_EQ(lease.unit.key.round, 0u);
        EXPECT_EQ(lease.tables.size_bytes, 0u);
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    }
    std::vector<std::pair<std::string, UnitLease>> units;
    for (int i = 0; i < 500 && units.empty(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        units = lease_all(service);
    }
    return units;
}

std::string guided(TableService& service, const UnitLease& lease) {
    const auto bytes = service.coordinator->assets().read(lease.tables.digest);
    if (!bytes.ok()) throw std::runtime_error(bytes.status().message());
    const auto guide = parse_tables(*bytes, lease.spec.algorithm.info().learning->parts);
    const auto generator = TrainingGenerator::create(*golden(), render_settings(lease.spec), *guide);
    return serialize(*generator->trace(lease.unit.training, {}));
}

TEST(GuidedTables, AreThoseOfASingleMachine) {
    TableService service({}, 1);
    const std::string id = service.submit_training(service.guided_spec());
    EXPECT_EQ(service.coordinator->get_job(id)->phase_total, kSamples) << "progress is that of the whole set";
    auto units = deliver_pilot(service);
    ASSERT_EQ(units.size(), 2u);
    const Digest guide = units[0].second.tables.digest;
    uint64_t samples = 0;
    for (const auto& [worker, lease] : units) {
        EXPECT_EQ(lease.unit.key.kind, UnitKind::kTraining);
        EXPECT_EQ(lease.unit.key.round, 1u);
        EXPECT_EQ(lease.tables.digest, guide);
        EXPECT_GE(lease.unit.training.first_sample, kTrainingUnitSamples);
        samples += lease.unit.training.sample_count;
    }
    EXPECT_EQ(samples, kSamples - kTrainingUnitSamples);
    std::reverse(units.begin(), units.end());
    for (const auto& [worker, lease] : units)
        EXPECT_EQ(service.give(worker, lease, guided(service, lease)).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    ASSERT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.tables.training_samples, kSamples);
    EXPECT_EQ(info.tables.asset.digest, tables_alone(service.guided_spec()));
    EXPECT_FALSE(service.coordinator->assets().contains(guide)) << "nobody needs it any more";
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

/// A worker that fell silent over the first round comes back in the second: its data have the size of a unit that is open, and were
/// traced without the guide all the same.
TEST(GuidedTables, ALateResultOfTheFirstRoundIsNotOneOfTheSecond) {
    TableService service;
    const std::string id = service.submit_training(service.guided_spec());
    const std::string silent = service.add_worker();
    const auto lost = service.lease(silent);
    ASSERT_EQ(lost.size(), 1u);
    const UnitLease& late = lost[0];
    ASSERT_EQ(late.unit.key.round, 0u);
    service.now_ms += 11000;
    service.wait(id, [](const JobInfo& j) { return j.unit_leased == 0; });
    const auto units = deliver_pilot(service);
    ASSERT_EQ(units.size(), 2u);
    const UnitLease& open = units[0].second;
    ASSERT_EQ(open.unit.key.group, late.unit.key.group);
    ASSERT_EQ(open.unit.training.sample_count, late.unit.training.sample_count);

    const auto revoked = service.coordinator->heartbeat(silent, {{late.reference(), true}});
    ASSERT_TRUE(revoked.ok());
    ASSERT_EQ(revoked->size(), 1u);
    EXPECT_EQ(revoked->front(), late.reference());
    EXPECT_EQ(service.coordinator->expected_training_bytes(late.reference()).status().code(), StatusCode::kNotFound);
    EXPECT_EQ(service.give(silent, late, traced(late)).outcome, SubmitOutcome::kStale);
    ASSERT_TRUE(service.coordinator->release_unit(silent, late.reference(), internal_error("boom")).ok());
    EXPECT_TRUE(lease_all(service).empty()) << "the unit of this round stays with its worker";
    for (const auto& [worker, lease] : units)
        EXPECT_EQ(service.give(worker, lease, guided(service, lease)).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    ASSERT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.tables.asset.digest, tables_alone(service.guided_spec()));
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

TEST(GuidedTables, TracingIsTimedFromItsFirstLeaseAndEachRoundOnce) {
    TableService service;
    const std::string id = service.submit_training(service.guided_spec());
    service.now_ms += 5000;
    const auto units = deliver_pilot(service, 2000);
    ASSERT_EQ(units.size(), 2u);
    service.now_ms += 3000;
    for (const auto& [worker, lease] : units) service.give(worker, lease, guided(service, lease));
    const JobInfo info = service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    ASSERT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.tables.trace_seconds, 5);
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

/// What waits does not: for workers before and between.
TEST(GuidedTables, TheTimeThatTheyTakeCountsTowardsTheLimit) {
    TableService service;
    JobSpec timed = service.table_spec(0);  // its set is chosen, so that nothing is measured first
    timed.time_limit_seconds = 10;
    const std::string id = service.submit_training(timed);
    service.now_ms += 60000;
    const auto units = lease_all(service);
    ASSERT_EQ(units.size(), 3u);
    service.now_ms += 1000;  // until the scene is there
    ASSERT_TRUE(service.coordinator->heartbeat(units[0].first, {{units[0].second.reference(), true}}).ok());
    service.now_ms += 6000;
    for (const auto& [worker, lease] : units)
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    service.wait(id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    service.now_ms += 5000;
    const auto lease = service.lease(units[0].first).at(0);
    ASSERT_TRUE(service.coordinator->heartbeat(units[0].first, {{lease.reference(), true}}).ok());
    EXPECT_EQ(service.coordinator->get_job(id)->eta_seconds, 4);
    service.now_ms += 1000;
    EXPECT_EQ(service.coordinator->get_job(id)->eta_seconds, 3);
    EXPECT_EQ(rendered_share(*service.coordinator->get_job(id)), 0.25);
    service.now_ms += 3001;
    EXPECT_EQ(service.deliver(units[0].first, lease).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.wait_end(id).samples_per_pixel_done, lease.unit.render.iteration_count);
}

/// Neither does the time in which an older job has all workers.
TEST(GuidedTables, TheTimeBetweenTheirUnitsIsNotTheJobs) {
    TableService service;
    const std::string older = service.submit_training(service.guided_spec());
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 10;
    const std::string younger = service.submit_training(timed);
    // The pilot of the older job is one unit, so that the other worker begins with the younger one.
    const std::string first = service.add_worker(), second = service.add_worker();
    const UnitLease pilot = service.lease(first).at(0);
    ASSERT_EQ(pilot.job_id, older);
    const auto trace_one = [&](const UnitLease& lease) {
        ASSERT_EQ(lease.job_id, younger);
        ASSERT_TRUE(service.coordinator->heartbeat(second, {{lease.reference(), true}}).ok());
        service.now_ms += 1000;
        const std::string& payload = traced(lease);
        EXPECT_EQ(service.give(second, lease, payload, sha256(payload), 1).outcome, SubmitOutcome::kAccepted);
    };
    for (int unit = 0; unit < 3; ++unit) {
        trace_one(service.lease(second).at(0));
        if (unit == 2 || HasFatalFailure()) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the coordinator looks fifty times a second
        for (int i = 0; i < 6; ++i) {
            service.now_ms += 9000;
            ASSERT_TRUE(service.coordinator->heartbeat(first, {{pilot.reference(), true}}).ok());
        }
    }
    ASSERT_FALSE(HasFatalFailure());
    service.wait(younger, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    const UnitLease lease = service.lease(second).at(0);
    ASSERT_EQ(lease.job_id, younger);
    ASSERT_TRUE(service.coordinator->heartbeat(second, {{lease.reference(), true}}).ok());
    EXPECT_EQ(service.coordinator->get_job(younger)->eta_seconds, 7);
    ASSERT_TRUE(service.coordinator->cancel_job(younger).ok());
    ASSERT_TRUE(service.coordinator->cancel_job(older).ok());
}

/// Nor that in which the coordinator reads the scene, which a worker may know from an earlier job.
TEST(GuidedTables, TheTimeOfReadingTheSceneIsNotTheJobs) {
    std::atomic<bool> read{false};
    TableService service([&](CoordinatorOptions& options) {
        options.read_scene = [&](const AssetStore&, const JobSpec&, std::stop_token) {
            SceneFacts facts = golden_facts();
            facts.build_scene = [&read, build = facts.build_scene] {
                while (!read) std::this_thread::sleep_for(std::chrono::milliseconds(1));
                return build();
            };
            return Result<SceneFacts>(std::move(facts));
        };
    });
    JobSpec timed = service.table_spec(0);
    timed.time_limit_seconds = 10;
    const std::string id = service.submit_training(timed);
    const auto units = lease_all(service);
    ASSERT_EQ(units.size(), 3u);
    ASSERT_TRUE(service.coordinator->heartbeat(units[0].first, {{units[0].second.reference(), true}}).ok());
    service.now_ms += 2000;
    for (const auto& [worker, lease] : units)
        EXPECT_EQ(service.give(worker, lease, traced(lease)).outcome, SubmitOutcome::kAccepted);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the coordinator looks fifty times a second
    service.now_ms += 60000;
    read = true;
    service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    const UnitLease lease = service.lease(units[0].first).at(0);
    ASSERT_TRUE(service.coordinator->heartbeat(units[0].first, {{lease.reference(), true}}).ok());
    EXPECT_EQ(service.coordinator->get_job(id)->eta_seconds, 8);
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

TEST(GuidedTables, AreCancelledInTheSecondRoundWithoutATrace) {
    TableService service;
    const std::string id = service.submit_training(service.guided_spec());
    const auto units = deliver_pilot(service);
    ASSERT_FALSE(units.empty());
    const Digest guide = units[0].second.tables.digest;
    EXPECT_TRUE(service.coordinator->assets().contains(guide));
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
    EXPECT_FALSE(service.coordinator->assets().contains(guide));
    EXPECT_EQ(service.give(units[0].first, units[0].second, "late").outcome, SubmitOutcome::kStale);
}

TEST(GuidedTables, AGuideThatTheDiskHasLostIsRestored) {
    TableService service;
    const std::string id = service.submit_training(service.guided_spec());
    const auto units = deliver_pilot(service);
    ASSERT_EQ(units.size(), 2u);
    const auto& [worker, lease] = units[0];
    const auto path = service.coordinator->assets().path_of(lease.tables.digest);
    ASSERT_TRUE(write_file_atomically(path.string(), "not what it was").ok());
    ASSERT_FALSE(service.coordinator->assets().read(lease.tables.digest).ok());
    ASSERT_TRUE(service.coordinator->release_unit(worker, lease.reference(), data_loss("damaged")).ok());
    EXPECT_TRUE(service.coordinator->assets().read(lease.tables.digest).ok());
    EXPECT_EQ(service.give(units[1].first, units[1].second, guided(service, units[1].second)).outcome, SubmitOutcome::kAccepted);
    for (const auto& [who, unit] : lease_all(service))
        EXPECT_EQ(service.give(who, unit, guided(service, unit)).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; }).state, JobState::kRunning);
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

/// One whose set has grown makes the tables of the spec that it records, as a job of that spec does.
TEST(GuidedTables, OfATimeLimitedJobAreThoseOfItsSpec) {
    TempDirectory cache;
    TableService service([&](CoordinatorOptions& options) { options.table_cache = cache.path; });
    JobSpec timed = service.guided_spec(0);
    timed.algorithm = without(timed.algorithm, "training-paths");
    timed.time_limit_seconds = 20;
    const std::string id = service.submit_training(timed);
    const auto probe = lease_all(service);
    ASSERT_EQ(probe.size(), 1u);
    ASSERT_EQ(probe[0].second.unit.key.kind, UnitKind::kProbe);
    service.give(probe[0].first, probe[0].second, traced(probe[0].second));
    JobInfo info = service.wait(id, [](const JobInfo& j) { return j.phase == PreparePhase::kTracing; });
    const auto pilot = lease_all(service);
    ASSERT_EQ(pilot.size(), 1u);
    EXPECT_EQ(pilot[0].second.unit.training, (TrainingWork{0, kPilotSamples, kPilotSamples}));
    // At such a rate another 16384 samples cost about 3 s, which is worth them, and 49152 about 8 s, which is not.
    const std::string& payload = traced(pilot[0].second);
    service.give(pilot[0].first, pilot[0].second, payload, sha256(payload), 2.0);
    service.wait(id, [](const JobInfo& j) { return j.phase == PreparePhase::kTracing && j.phase_total > kPilotSamples; });
    const auto units = lease_all(service);
    ASSERT_EQ(units.size(), 1u);
    EXPECT_EQ(units[0].second.unit.training, (TrainingWork{kPilotSamples, kPilotSamples, 2 * kPilotSamples}));
    EXPECT_EQ(service.give(units[0].first, units[0].second, guided(service, units[0].second)).outcome, SubmitOutcome::kAccepted);
    info = service.wait(id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    ASSERT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.spec.algorithm.value("training-paths"), 32768);
    JobSpec recorded = service.guided_spec();
    recorded.algorithm = recorded.algorithm.with("training-paths", 32768);
    EXPECT_TRUE(info.tables.capped_by_time_limit);
    EXPECT_EQ(info.tables.asset.digest, tables_alone(recorded));
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
    // A job whose probe promises no more than that takes the same tables.
    const std::string poorer = service.submit_training(timed);
    const auto again = lease_all(service);
    ASSERT_EQ(again.size(), 1u);
    ASSERT_EQ(again[0].second.unit.key.kind, UnitKind::kProbe);
    const std::string& probed = traced(again[0].second);
    service.give(again[0].first, again[0].second, probed, sha256(probed), 0.6);
    const JobInfo taken = service.wait(poorer, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
    EXPECT_EQ(taken.tables.asset.digest, info.tables.asset.digest);
    EXPECT_TRUE(taken.tables.from_cache);
    EXPECT_TRUE(taken.tables.capped_by_time_limit);
    EXPECT_EQ(taken.spec.algorithm.value("training-paths"), 32768);
    ASSERT_TRUE(service.coordinator->cancel_job(poorer).ok());
}

/// Without a set of its own, a job with samples has one that its image decides.
TEST(GuidedTables, OfAShortJobAreSmall) {
    TableService service;
    JobSpec brief = service.guided_spec(64);
    brief.algorithm = without(brief.algorithm, "training-paths");
    const std::string id = service.submit_training(brief);
    EXPECT_EQ(service.coordinator->get_job(id)->spec.algorithm.value("training-paths"), 16384) << "32 x 32 x 64 / 4";
    EXPECT_EQ(service.coordinator->get_job(id)->phase_total, 16384u);
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
}

/// Tasks of jobs look through the list of all jobs; one that is being taken apart is not theirs to see.
TEST(GuidedTables, ACoordinatorMayGoAtAnyMomentOfThem) {
    for (int pause = 0; pause < 40; pause += 4) {
        TableService service;
        const std::string over = service.submit_training(service.guided_spec(3));
        ASSERT_TRUE(service.coordinator->cancel_job(over).ok());
        const std::string maker = service.submit_training(service.guided_spec());
        service.submit_now(service.guided_spec());  // waits for these tables and takes them over
        const auto units = deliver_pilot(service);
        ASSERT_EQ(units.size(), 2u);
        for (const auto& [worker, lease] : units)
            EXPECT_EQ(service.give(worker, lease, guided(service, lease)).outcome, SubmitOutcome::kAccepted);
        // Every other time while they are learned; otherwise while they are taken over, which the next tick begins.
        if (pause % 8 != 0) service.wait(maker, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
        std::this_thread::sleep_for(std::chrono::milliseconds(pause));
        service.coordinator.reset();
    }
}

}  // namespace
}  // namespace lightloom::testing
