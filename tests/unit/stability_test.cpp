// Verdicts on estimators whose truth is known. The statistics of 200 judgements each: the generators are seeded, so that a test
// passes always or never.

#include "common/metrics/stability.h"

#include <gtest/gtest.h>

#include "tests/support/synthetic_runs.h"

namespace lightloom {
namespace {

using testing::exact_reference;
using testing::SyntheticImage;

constexpr int kJudgements = 200, kSeeds = 20;

/// How many of the judgements have each finding.
struct Tally {
    int biased = 0, misses_light = 0, heavy_tail = 0, stalls = 0, fireflies = 0, sound = 0, judged = 0;
    double slope = 0;
    std::string verdict;  ///< The last one.
};

Tally judge_often(const testing::Draw& draw, int judgements = kJudgements, double reference = 1) {
    Tally tally;
    const RgbImage image = SyntheticImage::grey(reference);
    for (int j = 0; j < judgements; ++j) {
        const auto runs = testing::synthetic_runs(1000 + uint64_t(j) * kSeeds, draw, image, kSeeds);
        const Stability s = *judge_stability(runs, exact_reference(image));
        tally.biased += s.biased, tally.misses_light += s.misses_light, tally.heavy_tail += s.heavy_tail;
        tally.stalls += s.stalls, tally.fireflies += s.has_fireflies, tally.sound += s.sound(), tally.judged += s.judged;
        tally.slope += s.slope->mean / judgements;
        tally.verdict = s.verdict;
    }
    ::testing::Test::RecordProperty("verdict", tally.verdict);
    return tally;
}

TEST(Stability, NormalNoiseIsSound) {
    const Tally t = judge_often(testing::normal_draw(0.5));
    EXPECT_EQ(t.sound, kJudgements) << t.verdict;
    EXPECT_NEAR(t.slope, -0.5, 0.01);
}

/// Skewed samples: the mean of 20 seeds is too dark more often than too bright.
TEST(Stability, SkewedNoiseIsNeverBiased) {
    for (const double sigma : {1.0, 2.0}) {
        const Tally t = judge_often(testing::lognormal_draw(sigma));
        EXPECT_EQ(t.biased, 0) << sigma << ": " << t.verdict;
        EXPECT_EQ(t.stalls, 0) << sigma << ": " << t.verdict;
        if (sigma == 1) {
            EXPECT_EQ(t.heavy_tail, 0) << t.verdict;
        }
    }
}

TEST(Stability, InfiniteVarianceIsAHeavyTailAndNoBias) {
    for (const double alpha : {1.5, 1.2}) {
        const Tally t = judge_often(testing::pareto_draw(alpha));
        EXPECT_EQ(t.biased, 0) << alpha << ": " << t.verdict;
        EXPECT_LT(t.sound, kJudgements * 1 / 10) << alpha << ": " << t.verdict;
        EXPECT_GT(t.heavy_tail, kJudgements * 8 / 10) << alpha << ": " << t.verdict;
        EXPECT_EQ(t.stalls, 0) << alpha << ": " << t.verdict;
    }
}

TEST(Stability, TwoPercentOfBiasAreConvicted) {
    for (const double mean : {1.02, 0.98}) {
        const Tally t = judge_often(testing::normal_draw(0.5, mean));
        EXPECT_GT(t.biased, kJudgements * 95 / 100) << t.verdict;
        EXPECT_EQ(t.misses_light, 0) << t.verdict;
        EXPECT_NE(t.verdict.find(mean > 1 ? "% too bright in" : "% too dark in"), std::string::npos) << t.verdict;
    }
}

TEST(Stability, TheRegionThatIsWrongIsNamed) {
    const auto draw = [](testing::Generator& g, int pixel) {
        const int x = pixel % SyntheticImage::kSize, y = pixel / SyntheticImage::kSize;
        return testing::normal_draw(0.2, x < 4 && y >= 8 ? 1.07 : 1)(g, pixel);
    };
    const RgbImage image = SyntheticImage::grey(1);
    const Stability s = *judge_stability(testing::synthetic_runs(5, draw, image), exact_reference(image));
    EXPECT_TRUE(s.biased);
    EXPECT_EQ(s.worst_region, 7u);
    EXPECT_NE(s.verdict.find("biased: 7.2 % too bright in the lower left ["), std::string::npos) << s.verdict;
}

/// Pixels are wrong and regions are right.
TEST(Stability, AnErrorThatStopsFallingStalls) {
    const auto draw = [](testing::Generator& g, int pixel) {
        return testing::normal_draw(0.5, (pixel % SyntheticImage::kSize + pixel / SyntheticImage::kSize) % 2 ? 1.2 : 0.8)(g, pixel);
    };
    const Tally t = judge_often(draw, 20);
    EXPECT_EQ(t.stalls, 20) << t.verdict;
    EXPECT_EQ(t.biased, 0) << t.verdict;
    EXPECT_EQ(t.heavy_tail, 0) << t.verdict;
}

/// One run of twenty has an outlier that the others lack.
TEST(Stability, OneSeedWithMostOfTheErrorIsAHeavyTail) {
    const RgbImage image = SyntheticImage::grey(1);
    auto runs = testing::synthetic_runs(1, testing::normal_draw(0.5), image);
    for (StabilityCheckpoint& c : runs[6].checkpoints) c.relmse *= 100;
    const Stability s = *judge_stability(runs, exact_reference(image));
    EXPECT_TRUE(s.heavy_tail);
    EXPECT_EQ(s.worst_seed, runs[6].seed);
    EXPECT_GT(s.worst_seed_share, 0.8);
    EXPECT_GT(s.spread, 50);
    EXPECT_NE(s.verdict.find("heavy tail: seed 7 has 8"), std::string::npos) << s.verdict;
}

TEST(Stability, LightThatOnlyChanceFindsProvesNoBias) {
    const RgbImage image = SyntheticImage::grey(1);
    const auto judge = [&](const ChanceLight& chance) {
        auto runs = testing::synthetic_runs(1, testing::normal_draw(0.5, 0.9), image);
        for (StabilityRun& run : runs) run.chance = chance;
        return *judge_stability(runs, exact_reference(image));
    };
    const Stability missed = judge({.share = 0.12, .unreachable_share = 0, .expected_hits = 0.01});
    EXPECT_TRUE(missed.misses_light) << missed.verdict;
    EXPECT_FALSE(missed.biased) << missed.verdict;
    EXPECT_NE(
        missed.verdict.find(
            "% too dark in the whole image [9.1, 11], because 12 % of the light is found by chance hits alone, of which 0.2 are "
            "expected in all seeds together"),
        std::string::npos)
        << missed.verdict;
    const Stability unreachable = judge({.share = 0, .unreachable_share = 0.1, .expected_hits = 0});
    EXPECT_FALSE(unreachable.biased);
    EXPECT_NE(unreachable.verdict.find("10 % of the light is never found"), std::string::npos) << unreachable.verdict;
    // So many hits are enough for the mean, and so little light is not what is missing.
    EXPECT_TRUE(judge({.share = 0.12, .unreachable_share = 0, .expected_hits = 1e4}).biased);
    EXPECT_TRUE(judge({.share = 0.02, .unreachable_share = 0, .expected_hits = 0.01}).biased);
}

TEST(Stability, FindingAlmostNothingIsSaid) {
    const Tally t = judge_often(testing::normal_draw(0.01, 0.03), 5);
    EXPECT_EQ(t.biased, 5);
    EXPECT_EQ(t.verdict.find("finds almost nothing: 3 % of the light ["), 0u) << t.verdict;
    const Tally black = judge_often([](testing::Generator&, int) { return 0; }, 1);
    EXPECT_NE(black.verdict.find("finds almost nothing: 0 % of the light"), std::string::npos) << black.verdict;
}

/// The error cannot fall below the reference's own. Checkpoints near it tell nothing.
TEST(Stability, TheNoiseOfTheReferenceIsNoStallAndNoBias) {
    for (const double deviation : {0.05, 0.15}) {
        testing::Generator generator(3);
        int stalls = 0, biased = 0;
        for (int j = 0; j < 50; ++j) {
            std::vector<double> pixels(SyntheticImage::kSize * SyntheticImage::kSize);
            const double each = 64 / deviation;
            for (size_t p = 0; p < pixels.size(); ++p) pixels[p] = testing::normal_draw(deviation)(generator, int(p));
            const RgbImage image = SyntheticImage::of(pixels);
            StabilityReference reference = exact_reference(image);
            for (size_t r = 0; r < reference.regions.size(); ++r)
                reference.regions[r].variance = deviation * deviation / (r == 0 ? 144 : 16);
            reference.floor = deviation * deviation;
            const Stability s = *judge_stability(
                testing::synthetic_runs(uint64_t(each) + 20 * uint64_t(j), testing::normal_draw(1), image), reference);
            stalls += s.stalls + s.heavy_tail, biased += s.biased;
        }
        EXPECT_EQ(stalls, 0);
        EXPECT_EQ(biased, 0);
    }
}

TEST(Stability, WhatIsNotKnownIsNotJudged) {
    const RgbImage image = SyntheticImage::grey(1);
    const auto runs = testing::synthetic_runs(1, testing::normal_draw(0.5, 1.5), image);
    StabilityReference unknown = exact_reference(image);
    unknown.floor.reset();
    for (Estimate& e : unknown.regions) e.variance = HUGE_VAL;
    const Stability s = *judge_stability(runs, unknown);
    EXPECT_FALSE(s.judged);
    EXPECT_FALSE(s.biased);
    EXPECT_FALSE(s.sound());
    EXPECT_FALSE(s.slope);
    EXPECT_NE(s.verdict.find("bias not judged: nobody knows"), std::string::npos) << s.verdict;
    EXPECT_EQ(s.flags(), std::vector<std::string>{"not-judged"});

    const Stability one = *judge_stability(std::span(runs).first(1), exact_reference(image));
    EXPECT_EQ(one.verdict, "bias not judged: that takes 5 seeds, not 1");
    const Stability four = *judge_stability(std::span(runs).first(4), exact_reference(image));
    EXPECT_NE(four.verdict.find("bias not judged: that takes 5 seeds, not 4"), std::string::npos) << four.verdict;
    EXPECT_FALSE(four.biased);
    const auto noisy = testing::synthetic_runs(1, testing::normal_draw(30), image);
    const Stability vague = *judge_stability(std::span(noisy).first(5), exact_reference(image));
    EXPECT_NE(vague.verdict.find("bias not judged: 5 seeds tell the mean only within"), std::string::npos) << vague.verdict;
}

TEST(Stability, BlackScenesAreSound) {
    const RgbImage black = SyntheticImage::grey(0);
    const auto runs = testing::synthetic_runs(
        1, [](testing::Generator&, int) { return 0; }, black);
    const Stability s = *judge_stability(runs, exact_reference(black));
    EXPECT_TRUE(s.sound()) << s.verdict;
    EXPECT_EQ(s.error.mean, 0);
    const auto lit = testing::synthetic_runs(1, testing::normal_draw(0.1), black);
    const std::string verdict = judge_stability(lit, exact_reference(black))->verdict;
    EXPECT_EQ(verdict.find("biased: light in the whole image, where the reference has none"), 0u) << verdict;
}

TEST(Stability, ReportsWhatItMeasured) {
    const RgbImage image = SyntheticImage::grey(1);
    auto runs = testing::synthetic_runs(1, testing::normal_draw(1), image, 4, 4);
    for (size_t i = 0; i < runs.size(); ++i) {
        const double up = double(i + 1);
        runs[i].checkpoints = {{1, 4 * up, 2 * up, 0.5 * up}, {2, 5 * up, 2 * up, {}}, {4, up, 0.25 * up, {}}};
        runs[i].fireflies = {.count = i, .energy = 0.01 * double(i)};
    }
    const Stability s = *judge_stability(runs, exact_reference(image));
    EXPECT_EQ(s.seeds, 4);
    EXPECT_DOUBLE_EQ(s.error.mean, 2.5);
    EXPECT_NEAR(s.error.error, std::sqrt(5.0 / 3 / 4), 1e-12);
    EXPECT_DOUBLE_EQ(s.spread, 4);
    EXPECT_EQ(s.worst_seed, runs[3].seed);
    EXPECT_DOUBLE_EQ(s.worst_seed_share, 0.4);
    EXPECT_DOUBLE_EQ(s.concentration, 0.75);
    EXPECT_DOUBLE_EQ(s.rising, 0.5);
    EXPECT_NEAR(s.slope->mean, -0.5, 1e-9) << "the middle point does not tilt the line";
    EXPECT_DOUBLE_EQ(s.firefly_count.mean, 1.5);
    EXPECT_TRUE(s.has_fireflies);
    EXPECT_TRUE(s.no_better_than_black);
    EXPECT_DOUBLE_EQ(s.tiny.iterations, 1);
    EXPECT_DOUBLE_EQ(s.tiny.relmse.mean, 10);
    EXPECT_DOUBLE_EQ(s.tiny.mean_ratio.mean, 1.25);
    EXPECT_DOUBLE_EQ(s.tiny.least_mean_ratio, 0.5);
}

TEST(Stability, RefusesRunsThatDoNotBelongTogether) {
    const RgbImage image = SyntheticImage::grey(1);
    const auto runs = testing::synthetic_runs(1, testing::normal_draw(1), image, 2, 4);
    const StabilityReference reference = exact_reference(image);
    const auto refused = [&](const std::vector<StabilityRun>& bad, const StabilityReference& r, const std::string& why) {
        const auto result = judge_stability(bad, r);
        ASSERT_FALSE(result.ok()) << why;
        EXPECT_EQ(result.status().code(), StatusCode::kInvalidArgument);
        EXPECT_NE(result.status().message().find(why), std::string::npos) << result.status().message();
    };
    refused({}, reference, "no runs");
    refused({runs[0], runs[0]}, reference, "seed 1: occurs twice");
    refused(runs, {}, "10 region means, the reference has 0");
    auto bad = runs;
    bad[1].checkpoints.clear();
    refused(bad, reference, "seed 2: has no checkpoints");
    bad = runs;
    std::swap(bad[1].checkpoints[0], bad[1].checkpoints[1]);
    refused(bad, reference, "do not ascend");
    bad = runs;
    bad[0].checkpoints[0].relmse = NAN;
    refused(bad, reference, "an error is not a positive number");
    bad = runs;
    bad[0].region_means[3] = HUGE_VAL;
    refused(bad, reference, "mean is not finite");
}

TEST(Fireflies, AreAboveTheReferenceAndAboveABlackPixelsShare) {
    std::vector<double> pixels(144, 1), bright = pixels;
    pixels[0] = 0, pixels[1] = 145;  // mean 2
    bright = pixels;
    const RgbImage reference = SyntheticImage::of(pixels);
    EXPECT_EQ(find_fireflies(reference, reference).count, 0u);
    bright[0] = 1.9;   // below the mean of the image
    bright[1] = 1400;  // less than ten times the reference
    bright[2] = 9.9;
    EXPECT_EQ(find_fireflies(SyntheticImage::of(bright), reference).count, 0u);
    bright[0] = 3, bright[2] = 11;
    const Fireflies found = find_fireflies(SyntheticImage::of(bright), reference);
    EXPECT_EQ(found.count, 2u);
    EXPECT_NEAR(found.energy, (3.0 + 10) / 287, 1e-6);
    const RgbImage black = SyntheticImage::grey(0);
    EXPECT_EQ(find_fireflies(reference, black).count, 0u);
}

}  // namespace
}  // namespace lightloom
