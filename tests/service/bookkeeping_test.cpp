// What the coordinator keeps, and for how long: the table of units, the workers, the sums, the list of jobs.

#include <gtest/gtest.h>

#include "common/core/atomic_file.h"
#include "common/scene/scene.h"
#include "server/reducer.h"
#include "server/scene_reader.h"
#include "server/training_round.h"
#include "server/worker_registry.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;

constexpr TimePoint kNever = TimePoint::max();

FrameLayout whole(int width, int height) { return {width, height, {0, 0, width, height}}; }

Digest digest_of(const UnitKey& key) { return sha256(std::to_string(key.group) + "/" + std::to_string(key.tile)); }

TEST(UnitTable, ALimitTakesLaterUnitsOutOfTheQueue) {
    UnitTable table(Plan(whole(40, 30), {.light_paths_per_iteration = 0}), 50, 8, std::nullopt);
    ASSERT_TRUE(table.has_more_than(4));
    const auto first = table.lease(0, {}, kNever), second = table.lease(0, {}, kNever);
    ASSERT_TRUE(first && second);
    EXPECT_TRUE(table.is_held(first->key, 0));
    EXPECT_FALSE(table.is_held(first->key, 1));
    table.limit_groups(1);
    EXPECT_FALSE(table.has_more_than(0)) << "what cannot be leased must not count";
    table.release(second->key, 0);
    EXPECT_FALSE(table.has_more_than(0));
    EXPECT_FALSE(table.lease(1, {}, kNever));
    table.release(first->key, 0);
    EXPECT_FALSE(table.is_held(first->key, 0));
    EXPECT_EQ(table.lease(1, {}, kNever)->key, first->key);
}

TEST(UnitTable, MergedGroupsStillAnswerForTheirUnits) {
    const Plan plan(whole(1000, 600), {.light_paths_per_iteration = 300000});
    ASSERT_GT(plan.tile_count(), 1u);
    UnitTable table(plan, 50, 2, std::nullopt);
    std::vector<WorkUnit> leased;
    for (uint32_t group = 0; group < table.group_total(); ++group) {
        for (uint32_t tile = 0; tile < plan.tile_count(); ++tile) {
            const auto unit = table.lease(tile, TimePoint(), kNever);
            ASSERT_TRUE(unit);
            leased.push_back(*unit);
            EXPECT_EQ(table.complete(unit->key, tile, digest_of(unit->key)), UnitTable::Completion::kFirst);
        }
        table.advance(group + 1);
    }
    EXPECT_FALSE(table.lease(0, TimePoint(), kNever));
    EXPECT_EQ(table.done_count(), table.unit_total());
    EXPECT_EQ(leased.size(), table.unit_total());
    const auto merged = table.merged();
    ASSERT_EQ(merged.size(), leased.size());
    uint64_t iterations = 0;
    for (size_t i = 0; i < leased.size(); ++i) {
        const UnitKey key = leased[i].key;
        EXPECT_EQ(merged[i].unit, key);
        EXPECT_EQ(merged[i].worker, key.tile);
        const auto found = table.find(key);
        ASSERT_TRUE(found);
        EXPECT_EQ(found->render, leased[i].render);
        EXPECT_EQ(table.complete(key, 9, digest_of(key)), UnitTable::Completion::kDuplicateSame);
        EXPECT_EQ(table.complete(key, 9, sha256("other")), UnitTable::Completion::kDuplicateDifferent);
        EXPECT_FALSE(table.renew(key, 9, {}, kNever));
        EXPECT_EQ(table.reopen(key).total, 0);
        if (key.tile == 0) iterations += found->render.iteration_count;
    }
    EXPECT_EQ(iterations, 50u);
    EXPECT_EQ(table.complete({table.group_total(), 0}, 0, {}), UnitTable::Completion::kUnknown);
    EXPECT_FALSE(table.find({0, plan.tile_count()}));
}

/// Keys come from the network. One that differs from a unit's own in kind or round alone once left the unit leased for ever behind
/// its merged result, and the table with an entry of nothing.
TEST(UnitTable, KeysOfOtherKindsAndRoundsAreNobodys) {
    UnitTable table(Plan(whole(100, 60), PlanOptions{}), 3, 8, std::nullopt);
    const auto unit = table.lease(0, TimePoint(), TimePoint());
    ASSERT_TRUE(unit);
    for (UnitKey key :
         {UnitKey{0, 0, UnitKind::kRender, 1}, UnitKey{0, 0, UnitKind::kTraining, 0}, UnitKey{0, 0, UnitKind::kProbe, 0}}) {
        EXPECT_FALSE(table.find(key));
        EXPECT_FALSE(table.renew(key, 0, {}, kNever));
        EXPECT_EQ(table.fail(key, 0).total, 0);
        EXPECT_EQ(table.complete(key, 0, sha256("x")), UnitTable::Completion::kUnknown);
    }
    EXPECT_EQ(table.leased_count(), 1u);
    EXPECT_EQ(table.expire(kNever).size(), 1u);
    EXPECT_EQ(table.complete(unit->key, 0, sha256("x")), UnitTable::Completion::kFirst);
    table.advance(1);
    EXPECT_EQ(table.complete({0, 0, UnitKind::kRender, 1}, 0, sha256("x")), UnitTable::Completion::kUnknown);
}

TEST(UnitTable, AMillionIterationsNeedNoRoomBeforeTheyAreLeased) {
    const auto begin = std::chrono::steady_clock::now();
    UnitTable table(Plan(whole(4000, 4000), {.light_paths_per_iteration = 4000 * 4000}), 1u << 24, 4, std::nullopt);
    EXPECT_GT(table.group_total(), 1u << 20);
    EXPECT_TRUE(table.lease(0, TimePoint(), kNever));
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(500));
}

TimePoint at_second(double seconds) { return seconds_after(TimePoint(), seconds); }

TEST(WorkerRegistry, KnowsWhoIsThereAndWhoIsIdle) {
    WorkerRegistry registry(10);
    WorkerRecord& first = registry.add({{}, 2, "host", 7}, at_second(0));
    WorkerRecord& second = registry.add({{}, 8, "host", 7}, at_second(0));
    EXPECT_NE(first.id, second.id) << "two workers of one process";
    EXPECT_EQ(registry.find(second.id), &second);
    EXPECT_EQ(&registry.at(first.index), &first);
    EXPECT_EQ(registry.find("worker-3-host-7"), nullptr);

    first.waiting = second.waiting = 1;
    second.held = {{"job", {0, 0}}};
    EXPECT_EQ(registry.idle(), 1u) << "the second has something to do";
    EXPECT_TRUE(second.has_room());
    second.held.insert({"job", {0, 1}});
    EXPECT_FALSE(second.has_room());

    const auto crew_at = [&](double seconds) { return registry.crew(at_second(seconds)); };
    EXPECT_EQ(crew_at(10).workers, 2u);
    EXPECT_EQ(crew_at(10).most_threads, 8u);
    first.last_heard = at_second(5);
    EXPECT_EQ(crew_at(11).workers, 1u);
    EXPECT_EQ(crew_at(11).most_threads, 2u);
    const auto statuses = registry.statuses(at_second(11));
    ASSERT_EQ(statuses.size(), 2u);
    EXPECT_EQ(statuses[first.index].state, WorkerState::kIdle);
    EXPECT_EQ(statuses[second.index].state, WorkerState::kGone);
    EXPECT_EQ(statuses[second.index].units_held, 2u);
    EXPECT_EQ(statuses[second.index].seconds_since_heard, 11);

    first.left = true;
    EXPECT_EQ(registry.find(first.id), nullptr);
    EXPECT_EQ(crew_at(6).workers, 1u);
    EXPECT_EQ(registry.statuses(at_second(6))[first.index].state, WorkerState::kGone);
    EXPECT_EQ(registry.at(first.index).id, first.id) << "manifests still name it";
}

TEST(WorkerRegistry, ASilenceIsHeldAgainstOneUnitOnly) {
    WorkerRegistry registry(10);
    WorkerRecord& worker = registry.add({{}, 1, "host", 1}, at_second(0));
    EXPECT_FALSE(registry.fell_silent(worker.index, at_second(4))) << "it was heard of: the lease was lost on the way";
    EXPECT_TRUE(registry.fell_silent(worker.index, at_second(11)));
    EXPECT_FALSE(registry.fell_silent(worker.index, at_second(12))) << "the same silence";
    worker.last_heard = at_second(13);
    EXPECT_TRUE(registry.fell_silent(worker.index, at_second(24))) << "another one";
    worker.last_heard = at_second(25);
    worker.left = true;
    EXPECT_FALSE(registry.fell_silent(worker.index, at_second(40))) << "it said goodbye";
}

/// The only splat of a unit's partial is `value`.
Partial splat_of(const WorkUnit& unit, double value) {
    Partial partial;
    partial.tile = unit.render.tile;
    partial.samples_per_pixel = unit.render.samples_per_pixel();
    partial.light_paths = unit.render.light_path_count;
    partial.camera.assign(size_t(3 * unit.render.tile.area()), 0.0);
    partial.splats.push_back({0, {value, 0, 0}});
    return partial;
}

/// Data that say which unit they are of.
TrainingRound::Part part_of(uint32_t unit, uint64_t bytes, double seconds) {
    TrainingPath path;
    path.estimate = float(unit);
    TrainingData data;
    data.blocks_x = data.blocks_y = 1;
    data.block_sum = {double(unit)};
    data.samples = 1;
    data.paths = {path};
    return {std::move(data), bytes, seconds};
}

TEST(TrainingRound, CountsWhatCameAndForgetsWhatIsRefused) {
    constexpr uint64_t kShort = 7, kEarlier = 3 * kTrainingUnitSamples, kCount = 2 * kTrainingUnitSamples + kShort;
    TrainingRound round(UnitKind::kTraining, 1, {kEarlier, kCount, kEarlier + kCount}, std::nullopt);
    EXPECT_EQ(round.samples_done(), kEarlier) << "those of the round before";
    for (uint32_t unit = 0; unit < 3; ++unit) ASSERT_EQ(round.units().lease(0, TimePoint(), kNever)->key.group, unit);
    const auto finish = [&](uint32_t unit) {
        const UnitKey key = round.key(unit);
        ASSERT_EQ(key, (UnitKey{unit, 0, UnitKind::kTraining, 1}));
        ASSERT_EQ(round.units().complete(key, 0, digest_of(key)), UnitTable::Completion::kFirst);
        round.add(unit, part_of(unit, 100 + unit, 1.5));
    };
    finish(2);
    EXPECT_EQ(round.bytes(), 102u);
    EXPECT_EQ(round.projected_bytes(), 306);
    finish(0);
    EXPECT_FALSE(round.complete());
    finish(1);
    EXPECT_TRUE(round.complete());
    EXPECT_EQ(round.samples_done(), kEarlier + kCount) << "the last unit is short";
    EXPECT_EQ(round.bytes(), 303u);
    EXPECT_EQ(round.traced_seconds(), 4.5);

    round.put_back(round.take());
    EXPECT_EQ(round.refuse(1).total, 1);
    EXPECT_FALSE(round.complete());
    EXPECT_EQ(round.bytes(), 202u);
    EXPECT_EQ(round.traced_seconds(), 3.0);
    ASSERT_EQ(round.units().lease(1, TimePoint(), kNever)->key.group, 1u);
    finish(1);

    // In the order of the units, not in that of their arrival.
    const auto all = join({}, round.take(), {});
    ASSERT_TRUE(all.ok()) << all.status().message();
    EXPECT_EQ(all->samples, 3u);
    ASSERT_EQ(all->paths.size(), 3u);
    for (uint32_t unit = 0; unit < 3; ++unit) EXPECT_EQ(all->paths[unit].estimate, float(unit));
    std::stop_source stopped;
    stopped.request_stop();
    std::vector<TrainingRound::Part> parts;
    parts.push_back(part_of(0, 1, 1));
    EXPECT_EQ(join({}, std::move(parts), stopped.get_token()).status().code(), StatusCode::kCancelled);
}

TEST(Reducer, APartialThatLeavesTheRangeOfALaterGroupIsTheOneRefused) {
    const FrameLayout frame = whole(1000, 600);
    const Plan plan(frame, {.light_paths_per_iteration = 300000});
    const uint32_t tiles = plan.tile_count();
    ASSERT_GE(tiles, 3u);
    const auto first = plan.units(plan.group(0)), second = plan.units(plan.group(1));
    Reducer reducer(frame, tiles);
    const double most = FixedSums::kRange * 0.75;
    // The tiles 0 and 2 of the second group, which comes first, exceed the range together.
    for (uint32_t tile = 0; tile < tiles; ++tile) {
        const auto refused = reducer.add(second[tile], splat_of(second[tile], tile == 0 || tile == 2 ? most : 1));
        ASSERT_TRUE(refused.ok()) << refused.status().message();
        ASSERT_EQ(refused->has_value(), tile == 2);
        if (tile == 2) {
            EXPECT_EQ((*refused)->code(), StatusCode::kDataLoss);
        }
    }
    for (uint32_t tile = 0; tile < tiles; ++tile) {
        const auto refused = reducer.add(first[tile], splat_of(first[tile], 1));
        ASSERT_TRUE(refused.ok()) << refused.status().message();
        EXPECT_FALSE(*refused);
    }
    // The others were kept: the unit alone completes its group.
    EXPECT_EQ(reducer.folded_groups(), 1u);
    const auto refused = reducer.add(second[2], splat_of(second[2], 1));
    ASSERT_TRUE(refused.ok());
    EXPECT_FALSE(*refused);
    EXPECT_EQ(reducer.folded_groups(), 2u);
}

/// A group that was folded lends its memory to the next. Nothing of it may stay there.
TEST(Reducer, GroupsThatComeInAnyOrderGiveTheSameBytes) {
    const FrameLayout frame = whole(1000, 600);
    const Plan plan(frame, {.light_paths_per_iteration = 300000});
    std::vector<WorkUnit> units;
    for (uint32_t group = 0; group < 6; ++group)
        for (const WorkUnit& unit : plan.units(plan.group(group))) units.push_back(unit);
    const auto developed = [&](const std::vector<WorkUnit>& order) {
        Reducer reducer(frame, plan.tile_count());
        for (const WorkUnit& unit : order) {
            Partial partial = splat_of(unit, 1 + unit.key.group);
            partial.camera.front() = 1e7 * double(unit.key.group + 1);  // beyond 64 bits, in some groups and pixels
            partial.splats.front().pixel = unit.key.group;
            const auto refused = reducer.add(unit, partial);
            EXPECT_TRUE(refused.ok() && !*refused);
        }
        EXPECT_EQ(reducer.folded_groups(), 6u);
        return *reducer.developed(true);
    };
    const DevelopedImage in_order = developed(units);
    std::vector<WorkUnit> order = units;
    std::reverse(order.begin(), order.end());
    const DevelopedImage backwards = developed(order);
    EXPECT_EQ(backwards.color.pixels, in_order.color.pixels);
    EXPECT_EQ(backwards.variance.pixels, in_order.variance.pixels);
    EXPECT_FLOAT_EQ(in_order.color.pixels[3 * 5], 6.0f * float(plan.tile_count()) / (6 * 300000))
        << "the last group's splats alone";
    EXPECT_FLOAT_EQ(in_order.color.pixels[0], 3.5e7f + float(plan.tile_count()) / (6 * 300000));
}

TEST(Reducer, WithoutAPartialThereIsNoImage) {
    const Reducer reducer(whole(60000, 1200), 4);  // whose sums would take 18 GB
    EXPECT_EQ(reducer.folded_groups(), 0u);
    EXPECT_EQ(reducer.iterations(), 0u);
    EXPECT_EQ(reducer.dropped(), 0u);
    EXPECT_EQ(reducer.developed(false).status().code(), StatusCode::kFailedPrecondition);
}

TEST(Reducer, AGroupThatDoesNotFitTheSumsIsAnError) {
    const FrameLayout frame = whole(10, 10);
    const Plan plan(frame, {.light_paths_per_iteration = 100});
    Reducer reducer(frame, 1);
    for (uint32_t group = 0; group < 2; ++group) {
        const WorkUnit unit = plan.units(plan.group(group))[0];
        const auto refused = reducer.add(unit, splat_of(unit, FixedSums::kRange * 0.75));
        EXPECT_EQ(refused.ok(), group == 0);
    }
    EXPECT_EQ(reducer.folded_groups(), 1u);
}

/// Units that workers can hold before any of them is merged.
size_t units_in_flight(uint64_t waiting_bytes) {
    FakeService service(whole(40, 30), std::nullopt, [&](CoordinatorOptions& o) { o.waiting_bytes = waiting_bytes; });
    service.submit(service.spec(4000));
    size_t count = 0;
    while (!service.lease(service.add_worker()).empty()) ++count;
    return count;
}

TEST(Coordinator, OpensOnlyGroupsThatTheRoomForWaitingGroupsHolds) {
    const uint64_t group_bytes = 40 * 30 * Reducer::open_group_bytes(true);
    EXPECT_EQ(units_in_flight(0), 1u);
    EXPECT_EQ(units_in_flight(group_bytes - 1), 1u);
    EXPECT_EQ(units_in_flight(5 * group_bytes), 6u);
}

TEST(Coordinator, AFrameThatTheMemoryCannotHoldIsRefusedWithWhatItTakes) {
    FakeService service(whole(8000, 1000), std::nullopt, [](CoordinatorOptions& o) { o.memory_bytes = 900'000'000; });
    const JobInfo job = service.wait_end(service.submit(service.spec(1)));
    EXPECT_EQ(job.state, JobState::kFailed);
    for (const char* part : {"8000000 pixels", "need about 1.0 GB", "host has 0.9 GB"})
        EXPECT_NE(job.message.find(part), std::string::npos) << job.message;
}

TEST(Coordinator, ForgetsTheOldestEndedJobsOnly) {
    FakeService service(whole(40, 30), std::nullopt, [](CoordinatorOptions& o) { o.kept_jobs = 2, o.max_jobs = 3; });
    const std::string running = service.submit(service.spec(1));
    std::vector<std::string> cancelled;
    for (int i = 0; i < 5; ++i) {
        cancelled.push_back(service.submit(service.spec(1)));
        ASSERT_TRUE(service.coordinator->cancel_job(cancelled.back()).ok());
    }
    for (int i = 0; i < 1000 && service.coordinator->list_jobs().size() > 3; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    const auto jobs = service.coordinator->list_jobs();
    ASSERT_EQ(jobs.size(), 3u);
    EXPECT_EQ(jobs[0].job_id, running);
    EXPECT_EQ(jobs[1].job_id, cancelled[3]);
    EXPECT_EQ(jobs[2].job_id, cancelled[4]);
    EXPECT_EQ(service.coordinator->get_job(cancelled[0]).status().code(), StatusCode::kNotFound);
    // Its request is forgotten with it: the same id is a new job.
    EXPECT_TRUE(service.coordinator->submit_job("request-2", service.spec(1)).ok());
    EXPECT_TRUE(service.coordinator->submit_job("third", service.spec(1)).ok());
    EXPECT_EQ(service.coordinator->submit_job("fourth", service.spec(1)).status().code(), StatusCode::kResourceExhausted);
}

TEST(Coordinator, DroppedSamplesOfGroupsBeyondTheImageDoNotCount) {
    FakeService service;
    JobSpec spec = service.spec(0);
    spec.time_limit_seconds = 10;
    const std::string id = service.submit(spec);
    std::vector<std::pair<std::string, UnitLease>> held;
    for (int i = 0; i < 3; ++i) {
        const std::string worker = service.add_worker();
        held.emplace_back(worker, service.lease(worker).at(0));
    }
    ASSERT_TRUE(service.coordinator->heartbeat(held[0].first, {{held[0].second.reference(), true}}).ok());
    // Groups 0 and 2 arrive, each with dropped samples; group 1 never does.
    for (const int i : {0, 2}) {
        const UnitLease& lease = held[size_t(i)].second;
        Partial partial = testing::fake_partial(lease.unit.render, lease.spec.frame);
        partial.dropped_count = uint64_t(i + 1);
        for (int d = 0; d <= i; ++d) partial.dropped.push_back({lease.unit.render.first_iteration, uint32_t(d), false});
        const auto encoded = encode_partial(partial, lease.spec.frame);
        ASSERT_TRUE(encoded.ok()) << encoded.status().message();
        const auto ack =
            service.coordinator->submit_payload(held[size_t(i)].first, lease.reference(), encoded->descriptor, encoded->payload);
        ASSERT_TRUE(ack.ok());
        EXPECT_EQ(ack->outcome, SubmitOutcome::kAccepted) << ack->reason;
    }
    EXPECT_EQ(service.coordinator->get_job(id)->dropped_samples, 4u);
    service.now_ms += 10001;
    const JobInfo info = service.wait_end(id);
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_EQ(info.samples_per_pixel_done, 1u);
    EXPECT_EQ(info.dropped_samples, 1u);
    EXPECT_EQ(info.camera_samples, 40u * 30u) << "of one group of one iteration";
    const auto manifest = service.coordinator->manifest(id);
    ASSERT_TRUE(manifest.ok());
    EXPECT_NE(manifest->find("\"iteration\": 0"), std::string::npos);
    EXPECT_EQ(manifest->find("\"iteration\": 2"), std::string::npos);
}

TEST(SceneReader, FactsKeepNoSceneAndBuildItWhenAsked) {
    const testing::TempDirectory directory;
    const std::filesystem::path scenes = std::filesystem::path(LIGHTLOOM_SOURCE_DIR) / "tests/scenes";
    const auto manifest = AssetManifest::of_files(scenes, {"furnace-box.pbrt"});
    ASSERT_TRUE(manifest.ok()) << manifest.status().message();
    AssetStore assets(directory.path / "assets");
    ASSERT_TRUE(assets.put(manifest->root(), manifest->canonical_text()).ok());
    ASSERT_TRUE(assets.put(manifest->entries[0].digest, *read_file((scenes / "furnace-box.pbrt").string())).ok());
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("spcbpt");
    spec.scene_root = manifest->root();
    spec.width = spec.height = 16;
    const auto facts = make_scene_reader(directory.path / "scratch")(assets, spec, {});
    ASSERT_TRUE(facts.ok()) << facts.status().message();
    // What took the description over could do so once only.
    for (int i = 0; i < 2; ++i) {
        const auto scene = facts->build_scene();
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        EXPECT_EQ((*scene)->frame(), facts->frame);
        EXPECT_FALSE((*scene)->emitters().all().empty());
    }
    assets.remove(manifest->entries[0].digest);
    EXPECT_FALSE(facts->build_scene().ok()) << "it was read again";
}

TEST(Coordinator, AWaitThatIsNotANumberIsRefused) {
    FakeService service;
    const std::string worker = service.add_worker();
    for (const double wait : {std::nan(""), -1.0}) {
        const auto leases = service.coordinator->lease_units(worker, wait, [] { return false; });
        EXPECT_EQ(leases.status().code(), StatusCode::kInvalidArgument);
    }
}

}  // namespace
}  // namespace lightloom
