// A reducer and a table of units that go on from a saved state are as if there had been no break.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "common/core/rng.h"
#include "server/reducer.h"
#include "server/results.h"
#include "server/unit_table.h"

namespace lightloom {
namespace {

constexpr FrameLayout kFrame{70, 50, {3, 2, 60, 45}};

FilmResponse coloured() {
    FilmResponse response;
    response.exposure = 0.75;
    response.colour = {{{0.9, 0.1, 0}, {0, 1.1, -0.05}, {0.2, 0, 0.8}}};
    return response;
}

/// A partial that depends on its unit alone.
Partial partial_of(const WorkUnit& unit, bool splats, double noise) {
    Partial partial;
    partial.tile = unit.render.tile;
    partial.samples_per_pixel = unit.render.samples_per_pixel();
    partial.light_paths = unit.render.light_path_count;
    Rng rng({1, Stage::kCamera, unit.key.group, unit.key.tile});
    const auto value = [&] { return 1 - noise + 2 * noise * rng.uniform_double(); };
    partial.camera.resize(size_t(3 * partial.tile.area()));
    for (double& v : partial.camera) v = value() * partial.samples_per_pixel;
    partial.camera[0] = 3e6 * (unit.key.group % 3);  // upper words in some groups
    partial.camera[4] = -5;
    if (splats) {
        for (uint32_t pixel = 5; pixel < uint32_t(kFrame.crop.area()); pixel += 1 + unit.key.group % 4)
            partial.splats.push_back({pixel, {value(), 1e7 * value(), 0}});
    }
    partial.dropped_count = unit.key.group % 2;
    if (partial.dropped_count) partial.dropped = {{unit.key.group, 7, splats}};
    partial.counters = {1000000, 20, 30, 40, 50 + unit.key.group};
    if (unit.key == UnitKey{}) partial.rare_light = {Rgb(0.01f), Rgb(0.002f), 0.3, 100};
    return partial;
}

void add(Reducer& reducer, const WorkUnit& unit, bool splats, double noise) {
    const auto refused = reducer.add(unit, partial_of(unit, splats, noise));
    ASSERT_TRUE(refused.ok()) << refused.status().message();
    ASSERT_FALSE(*refused) << (*refused)->message();
}

void expect_equal(const Reducer& a, const Reducer& b) {
    ASSERT_EQ(a.folded_groups(), b.folded_groups());
    EXPECT_EQ(a.iterations(), b.iterations());
    EXPECT_EQ(a.dropped(), b.dropped());
    EXPECT_EQ(a.noise(), b.noise());
    EXPECT_EQ(a.final_noise(), b.final_noise());
    EXPECT_EQ(a.counters().connections, b.counters().connections);
    EXPECT_EQ(a.counters().camera_samples, b.counters().camera_samples);
    EXPECT_EQ(a.rare_light_report(0.5), b.rare_light_report(0.5));
    ASSERT_EQ(a.first_dropped().size(), b.first_dropped().size());
    for (size_t i = 0; i < a.first_dropped().size(); ++i) {
        EXPECT_EQ(a.first_dropped()[i].unit, b.first_dropped()[i].unit);
        EXPECT_EQ(a.first_dropped()[i].sample, b.first_dropped()[i].sample);
    }
    const auto image = a.developed(true), other = b.developed(true);
    EXPECT_EQ(image->color.pixels, other->color.pixels);
    EXPECT_EQ(image->variance.pixels, other->variance.pixels);
    EXPECT_EQ(a.serialize()->bytes, b.serialize()->bytes);
}

TEST(RestoredReducer, GoesOnAsIfThereHadBeenNoBreak) {
    const double noise = 0.1;
    for (const bool splats : {false, true}) {
        const Plan plan(kFrame, {.light_paths_per_iteration = splats ? 1000u : 0u});
        std::vector<WorkUnit> units;
        for (uint32_t group = 0; group < 24; ++group)
            for (const WorkUnit& unit : plan.units(plan.group(group))) units.push_back(unit);
        Reducer first(kFrame, plan.tile_count(), coloured());
        for (const WorkUnit& unit : units)
            if (unit.key.group < 14) add(first, unit, splats, noise);
        const NoiseEstimate after_14 = first.final_noise()->estimate;
        for (const double target : {0.0, (after_14.relmse + after_14.error) * 1.001}) {
            Reducer whole(kFrame, plan.tile_count(), coloured(), target);
            for (const WorkUnit& unit : units) add(whole, unit, splats, noise);
            EXPECT_EQ(whole.noise()->reached, target > 0) << "the target is one that ends it on the way";
            EXPECT_EQ(whole.folded_groups() == 24, target == 0);

            Rng rng({2, Stage::kCamera, splats});
            for (int trial = 0; trial < 12; ++trial) {
                // Results come a little out of order, and every now and then all begins again with what was saved.
                std::vector<WorkUnit> order = units;
                for (size_t i = 0; i + 4 < order.size(); ++i) std::swap(order[i], order[i + size_t(rng.uniform_double() * 4)]);
                auto reducer = std::make_unique<Reducer>(kFrame, plan.tile_count(), coloured(), target);
                for (size_t i = 0; i < order.size(); ++i) {
                    add(*reducer, order[i], splats, noise);
                    if (rng.uniform_double() > 0.2) continue;
                    const auto saved = reducer->serialize();
                    ASSERT_EQ(saved.ok(), reducer->folded_groups() > 0);
                    if (!saved.ok()) continue;
                    EXPECT_EQ(saved->groups, reducer->folded_groups());
                    reducer = std::make_unique<Reducer>(kFrame, plan.tile_count(), coloured(), target);
                    ASSERT_TRUE(reducer->restore(saved->bytes).ok());
                    for (size_t j = 0; j <= i; ++j)
                        if (order[j].key.group >= saved->groups) add(*reducer, order[j], splats, noise);
                }
                expect_equal(*reducer, whole);
            }
        }
    }
}

TEST(RestoredReducer, RefusesWhatIsDamagedOrNotItsOwn) {
    const Plan plan(kFrame, PlanOptions{});
    Reducer reducer(kFrame, plan.tile_count(), coloured());
    EXPECT_EQ(reducer.serialize().status().code(), StatusCode::kFailedPrecondition);
    for (uint32_t group = 0; group < 3; ++group)
        for (const WorkUnit& unit : plan.units(plan.group(group))) add(reducer, unit, false, 0.1);
    const std::string bytes = reducer.serialize()->bytes;
    EXPECT_EQ(reducer.restore(bytes).code(), StatusCode::kFailedPrecondition) << "it is in use";

    const auto restored = [&](const std::string& state, const FrameLayout& frame, uint32_t tiles, double exposure, double target) {
        FilmResponse response = coloured();
        response.exposure = exposure;
        Reducer fresh(frame, tiles, response, target);
        const Status status = fresh.restore(state);
        EXPECT_EQ(fresh.folded_groups(), status.ok() ? 3u : 0u);
        return status.code();
    };
    const auto of_bytes = [&](const std::string& state) { return restored(state, kFrame, plan.tile_count(), 0.75, 0); };
    EXPECT_EQ(of_bytes(bytes), StatusCode::kOk);
    for (size_t size = 0; size < bytes.size(); size += 1 + size / 3)
        EXPECT_EQ(of_bytes(bytes.substr(0, size)), StatusCode::kDataLoss);
    for (size_t at = 0; at < bytes.size(); at += 1 + at / 3) {
        std::string damaged = bytes;
        damaged[at] ^= 1;
        EXPECT_EQ(of_bytes(damaged), StatusCode::kDataLoss) << at;
    }
    // Whole, but of another version, or of something else.
    const auto resealed = [](std::string state) {
        seal_state(state);
        return state;
    };
    std::string body = bytes.substr(0, bytes.size() - 32);
    EXPECT_EQ(of_bytes(resealed(body.substr(0, body.size() - 1))), StatusCode::kFailedPrecondition);
    EXPECT_EQ(of_bytes(resealed(std::string(body).append("x"))), StatusCode::kFailedPrecondition);
    body[4] = 2;
    EXPECT_EQ(of_bytes(resealed(body)), StatusCode::kFailedPrecondition) << "the version";
    FrameLayout other = kFrame;
    --other.crop.x1;
    EXPECT_EQ(restored(bytes, other, plan.tile_count(), 0.75, 0), StatusCode::kFailedPrecondition);
    EXPECT_EQ(restored(bytes, kFrame, plan.tile_count() + 1, 0.75, 0), StatusCode::kFailedPrecondition);
    EXPECT_EQ(restored(bytes, kFrame, plan.tile_count(), 0.7, 0), StatusCode::kFailedPrecondition);
    EXPECT_EQ(restored(bytes, kFrame, plan.tile_count(), 0.75, 0.1), StatusCode::kFailedPrecondition);
}

constexpr TimePoint kNever = TimePoint::max();

Digest digest_of(const UnitKey& key) { return sha256(std::to_string(key.group) + "/" + std::to_string(key.tile)); }

TEST(RestoredUnitTable, KnowsEveryResultAndLeasesTheOthers) {
    const FrameLayout frame{1000, 600, {0, 0, 1000, 600}};
    const Plan plan(frame, {.light_paths_per_iteration = 300000});
    const uint32_t tiles = plan.tile_count();
    ASSERT_GT(tiles, 2u);
    for (const uint64_t iterations : {uint64_t(0), uint64_t(12)}) {
        // Groups 0 to 3 are merged, of 4 and 6 some units have come, although two groups may be open only.
        std::vector<UnitTable::Known> known;
        for (uint32_t group = 0; group < 4; ++group)
            for (uint32_t tile = 0; tile < tiles; ++tile) known.push_back({{group, tile}, tile + 10, digest_of({group, tile})});
        for (const UnitKey& key : {UnitKey{4, 1}, UnitKey{6, 0}}) known.push_back({key, 5, digest_of(key)});
        std::reverse(known.begin(), known.end());
        UnitTable table(plan, iterations, 2, std::nullopt);
        ASSERT_TRUE(table.restore(4, known).ok());
        EXPECT_EQ(table.done_count(), known.size());
        EXPECT_EQ(table.leased_count(), 0u);
        const auto merged = table.merged();
        ASSERT_EQ(merged.size(), 4 * tiles);
        EXPECT_EQ(merged[tiles + 1].unit, (UnitKey{1, 1}));
        EXPECT_EQ(merged[tiles + 1].worker, 11u);
        for (const UnitTable::Known& result : known) {
            ASSERT_TRUE(table.find(result.unit));
            EXPECT_EQ(table.find(result.unit)->key, result.unit);
            EXPECT_EQ(table.complete(result.unit, 9, result.digest), UnitTable::Completion::kDuplicateSame);
            EXPECT_EQ(table.complete(result.unit, 9, sha256("other")), UnitTable::Completion::kDuplicateDifferent);
        }
        std::set<UnitKey> rest;
        while (const auto unit = table.lease(1, TimePoint(), kNever)) {
            rest.insert(unit->key);
            if (unit->key.group > 6) break;
            EXPECT_EQ(table.complete(unit->key, 1, digest_of(unit->key)), UnitTable::Completion::kFirst);
        }
        EXPECT_EQ(rest.size(), 3 * tiles - 2);
        EXPECT_TRUE(rest.contains({5, 0}));
        EXPECT_FALSE(rest.contains({4, 1}));
        table.advance(7);
        EXPECT_EQ(table.merged().size(), 7 * tiles);
        EXPECT_EQ(table.merged()[4 * tiles + 1].worker, 5u);
        // A result whose payload was lost is made again.
        UnitTable again(plan, iterations, 2, std::nullopt);
        ASSERT_TRUE(again.restore(4, known).ok());
        EXPECT_EQ(again.reopen({4, 1}).total, 1);
        EXPECT_EQ(again.done_count(), known.size() - 1);
    }
}

TEST(RestoredUnitTable, RefusesWhatCannotBe) {
    const Plan plan({100, 60, {0, 0, 100, 60}}, PlanOptions{});
    ASSERT_EQ(plan.tile_count(), 1u);
    const auto refused = [&](uint32_t merged, std::vector<UnitTable::Known> known) {
        UnitTable table(plan, 6, 8, std::nullopt);
        return table.restore(merged, known);
    };
    EXPECT_TRUE(refused(0, {}).ok());
    EXPECT_TRUE(refused(1, {{{0, 0}, 0, {}}, {{5, 0}, 0, {}}}).ok());
    EXPECT_EQ(refused(2, {{{0, 0}, 0, {}}}).message(), "the saved results of the merged group 1 are not complete");
    for (const UnitKey& key : {UnitKey{0, 1}, UnitKey{6, 0}, UnitKey{UINT32_MAX, 0}, UnitKey{0, 0, UnitKind::kTraining, 0}})
        EXPECT_EQ(refused(0, {{key, 0, {}}}).code(), StatusCode::kDataLoss);
}

}  // namespace
}  // namespace lightloom
