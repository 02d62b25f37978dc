// Shares of techniques in light and noise: which classes an algorithm can have, that shares add up, and what is refused.

#include "client/bench/technique_shares.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "common/transport/training.h"
#include "tests/support/small_scenes.h"
#include "tests/support/stub_rows.h"

namespace lightloom::client {
namespace {

using lightloom::testing::cornell_builder;
using lightloom::testing::SceneBuilder;

const bool kStubs = lightloom::testing::add_stub_rows();

enum { kHits, kOneLightVertex, kConnections, kLightTracing, kMerging, kClasses };

RenderSettings settings_of(const std::string& algorithm, int max_depth = 4) {
    return {*AlgorithmSettings::parse(algorithm, {}), 1, max_depth};
}

TechniqueShares shares_of(const std::shared_ptr<const Scene>& scene, const RenderSettings& settings, uint32_t iterations = 2,
                          uint32_t seeds = 4) {
    const Result<TechniqueShares> shares = technique_shares(scene, settings, {}, iterations, seeds, {});
    EXPECT_TRUE(shares.ok()) << shares.status().message();
    return shares.ok() ? *shares : TechniqueShares{.classes = std::vector<TechniqueShare>(kClasses)};
}

void expect_sums_of_one(const TechniqueShares& shares) {
    ASSERT_EQ(shares.classes.size(), size_t(kClasses));
    double light = 0, noise = 0;
    for (const TechniqueShare& share : shares.classes) {
        EXPECT_GE(share.light, 0) << share.name;
        EXPECT_GE(share.noise, 0) << share.name;
        light += share.light;
        noise += share.noise;
    }
    EXPECT_NEAR(light, 1, 1e-12);
    EXPECT_NEAR(noise, 1, 1e-12);
    EXPECT_GT(shares.relative_variance, 0);
}

TEST(TechniqueShares, PathHasHitsAndNextEventAlone) {
    const TechniqueShares shares = shares_of(cornell_builder(16).build(), settings_of("path"));
    expect_sums_of_one(shares);
    EXPECT_EQ(shares.iterations, 2u);
    EXPECT_EQ(shares.seeds, 4u);
    EXPECT_EQ(shares.classes[kHits].name, "emitter hits");
    for (const int c : {kHits, kOneLightVertex}) {
        EXPECT_GT(shares.classes[c].light, 0);
        EXPECT_GT(shares.classes[c].noise, 0);
    }
    for (const int c : {kConnections, kLightTracing, kMerging}) {
        EXPECT_EQ(shares.classes[c].light, 0);
        EXPECT_EQ(shares.classes[c].noise, 0);
    }
}

TEST(TechniqueShares, LightTracesLightAndBdptDoesEverythingButMerge) {
    const std::shared_ptr<const Scene> scene = cornell_builder(16).build();
    const TechniqueShares light = shares_of(scene, settings_of("light"));
    expect_sums_of_one(light);
    EXPECT_NEAR(light.classes[kLightTracing].light, 1, 1e-12);
    const TechniqueShares bdpt = shares_of(scene, settings_of("bdpt"));
    expect_sums_of_one(bdpt);
    for (const int c : {kHits, kOneLightVertex, kConnections, kLightTracing}) EXPECT_GT(bdpt.classes[c].light, 0) << c;
    EXPECT_EQ(bdpt.classes[kMerging].light, 0);
}

TEST(TechniqueShares, MergesAreAClassOfTheirOwn) {
    ASSERT_TRUE(kStubs);
    const std::shared_ptr<const Scene> scene = cornell_builder(16).build();
    RenderSettings merging = settings_of(lightloom::testing::kStubMerging);
    merging.algorithm = merging.algorithm.with("photons", 0.5);
    const TechniqueShares merged = shares_of(scene, merging);
    expect_sums_of_one(merged);
    EXPECT_GT(merged.classes[kMerging].light, 0);
    EXPECT_EQ(merged.classes[kConnections].light, 0);
}

/// With one edge to a path, hits of emitters that are in sight are all that there is.
TEST(TechniqueShares, DirectSightOfALampIsHits) {
    SceneBuilder upwards = cornell_builder(16);
    upwards.look({0, 1, -0.95f}, {0, 1.9f, 0.2f}, 80);
    const TechniqueShares shares = shares_of(upwards.build(), settings_of("bdpt", 0));
    EXPECT_EQ(shares.classes[kHits].light, 1);
    EXPECT_EQ(shares.classes[kHits].noise, 1);
}

TEST(TechniqueShares, TheTablesOfAnAlgorithmThatLearnsAreUsed) {
    const std::shared_ptr<const Scene> scene = cornell_builder(16).build();
    const RenderSettings settings{
        *AlgorithmSettings::parse("spcbpt", {{"training-paths", "2000"}, {"light-subspaces", "20"}, {"eye-subspaces", "20"}}), 1,
        4};
    TrainingReport report;
    const Result<Tables> tables = make_tables(*scene, settings, {}, &report);
    ASSERT_TRUE(tables.ok()) << tables.status().message();
    const Result<TechniqueShares> shares = technique_shares(scene, settings, *tables, 2, 2, {});
    ASSERT_TRUE(shares.ok()) << shares.status().message();
    expect_sums_of_one(*shares);
    EXPECT_GT(shares->classes[kConnections].light, 0);
    EXPECT_EQ(technique_shares(scene, settings, {}, 2, 2, {}).status().code(), StatusCode::kFailedPrecondition);
}

TEST(TechniqueShares, DoNotDependOnTheNumberOfThreads) {
    const std::shared_ptr<const Scene> scene = cornell_builder(16).build();
    TechniqueShares by_threads[2];
    for (const int threads : {1, 3})
        by_threads[threads / 2] = tbb::task_arena(threads).execute([&] { return shares_of(scene, settings_of("bdpt"), 2, 5); });
    EXPECT_EQ(by_threads[0].relative_variance, by_threads[1].relative_variance);
    for (size_t c = 0; c < kClasses; ++c) {
        EXPECT_EQ(by_threads[0].classes[c].light, by_threads[1].classes[c].light);
        EXPECT_EQ(by_threads[0].classes[c].noise, by_threads[1].classes[c].noise);
    }
}

/// Longer renderings vary less, but not per iteration, except that their samples are spread more evenly over a pixel.
TEST(TechniqueShares, VarianceIsThatOfOneIteration) {
    const std::shared_ptr<const Scene> scene = cornell_builder(16).build();
    const TechniqueShares one = shares_of(scene, settings_of("path"), 1, 64), four = shares_of(scene, settings_of("path"), 4, 64);
    EXPECT_LT(four.relative_variance / one.relative_variance, 1.1);
    EXPECT_GT(four.relative_variance / one.relative_variance, 0.5);
    EXPECT_NEAR(four.classes[kHits].light, one.classes[kHits].light, 0.03);
}

TEST(TechniqueShares, RefuseWhatHasNoAnswer) {
    const std::shared_ptr<const Scene> scene = cornell_builder(8).build();
    EXPECT_EQ(technique_shares(scene, settings_of("path"), {}, 0, 4, {}).status().code(), StatusCode::kInvalidArgument);
    EXPECT_EQ(technique_shares(scene, settings_of("path"), {}, 4, 1, {}).status().code(), StatusCode::kInvalidArgument);

    SceneBuilder away = cornell_builder(8);
    away.look({0, 1, -0.95f}, {0, 0.2f, 1}, 20);  // no lamp in sight
    const Status dark = technique_shares(away.build(), settings_of("path", 0), {}, 1, 2, {}).status();
    EXPECT_EQ(dark.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(dark.message().find("'path' found no light in 2 x 1 iterations"), std::string::npos) << dark.message();

    const Status owned = technique_shares(scene, settings_of(lightloom::testing::kStubPairing), {}, 1, 2, {}).status();
    EXPECT_EQ(owned.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(owned.message().find("'stub-pairing' does its own loops"), std::string::npos) << owned.message();

    std::stop_source stopped;
    stopped.request_stop();
    EXPECT_EQ(technique_shares(scene, settings_of("path"), {}, 2, 2, stopped.get_token()).status().code(), StatusCode::kCancelled);
}

}  // namespace
}  // namespace lightloom::client
