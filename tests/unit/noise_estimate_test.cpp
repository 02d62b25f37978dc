// NoiseEstimate on synthetic groups whose distribution is known.

#include "common/film/noise_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "common/core/rng.h"
#include "common/film/accumulation.h"

namespace lightloom {
namespace {

const FrameLayout kFrame{48, 32, {0, 0, 48, 32}};

/// Value of a pixel's channel in one iteration; `common` is uniform in [0, 1) and the same for all pixels of the iteration.
using Draw = std::function<double(size_t index, double common, Rng& rng)>;

Accumulation render(int groups, uint64_t seed, const Draw& draw, const FilmResponse& response = {}) {
    Accumulation sums(kFrame, response);
    for (int g = 0; g < groups; ++g) {
        const uint32_t iterations = g < groups / 2 ? 1 : 3;  // unequal groups, as plans have
        Partial partial;
        partial.tile = kFrame.crop;
        partial.samples_per_pixel = iterations;
        partial.camera.resize(size_t(kFrame.crop.area()) * 3);
        for (uint32_t i = 0; i < iterations; ++i) {
            Rng rng({seed, Stage::kCamera, uint64_t(g) * 8 + i});
            const double common = rng.uniform_double();
            for (size_t k = 0; k < partial.camera.size(); ++k) partial.camera[k] += draw(k, common, rng);
        }
        GroupSum group(kFrame);
        EXPECT_TRUE(group.add(partial).ok());
        EXPECT_TRUE(sums.fold(group, iterations).ok());
    }
    return sums;
}

double true_relmse(const RgbImage& image, const std::function<double(size_t)>& truth) {
    double sum = 0;
    for (size_t k = 0; k < image.pixels.size(); ++k) {
        const double r = truth(k), d = image.pixels[k] - r;
        sum += d * d / (r * r + 0.01);
    }
    return sum / double(image.pixels.size());
}

/// Two halves of different brightness, one of them textured.
double scene(size_t k) {
    const size_t x = k / 3 % 48;
    return x < 24 ? 0.05 : 1 + double(k % 7);
}

TEST(NoiseEstimate, IndependentPixelsOfKnownVarianceWithinTheConfidence) {
    int covered = 0, good = 0;
    const int runs = 60;
    for (int run = 0; run < runs; ++run) {
        // Uniform in [0, 2 r]: variance r^2 / 3.
        const Accumulation sums =
            render(24, uint64_t(run), [](size_t k, double, Rng& rng) { return 2 * scene(k) * rng.uniform_double(); });
        double expected = 0;
        for (size_t k = 0; k < size_t(kFrame.crop.area()) * 3; ++k) {
            const double square = scene(k) * scene(k);
            expected += square / 3 / double(sums.iterations()) / (square + 0.01);
        }
        expected /= double(kFrame.crop.area()) * 3;
        const auto noise = sums.noise();
        ASSERT_TRUE(noise.has_value());
        covered += std::fabs(noise->relmse - expected) < 2 * noise->error + 0.03 * expected;
        good += noise->error < 0.1 * noise->relmse;
        EXPECT_NEAR(noise->relmse / true_relmse(sums.develop(), scene), 1, 0.15);
    }
    EXPECT_GE(covered, runs * 9 / 10);
    EXPECT_EQ(good, runs) << "thousands of independent pixels tell the error to some per cent";
}

TEST(NoiseEstimate, CorrelatedPixelsWidenTheConfidence) {
    int covered = 0;
    double error = 0;
    const int runs = 100, groups = 40;
    for (int run = 0; run < runs; ++run) {
        const Accumulation sums = render(groups, 500 + uint64_t(run), [](size_t k, double common, Rng&) {
            return scene(k) * (0.5 + common);  // variance r^2 / 12
        });
        const double iterations = double(sums.iterations());
        double expected = 0;
        for (size_t k = 0; k < size_t(kFrame.crop.area()) * 3; ++k) {
            const double square = scene(k) * scene(k);
            expected += square / 12 / iterations / (square + 0.01);
        }
        expected /= double(kFrame.crop.area()) * 3;
        const auto noise = sums.noise();
        ASSERT_TRUE(noise.has_value());
        covered += std::fabs(noise->relmse - expected) < 2 * noise->error;
        error += noise->error / noise->relmse / runs;
    }
    EXPECT_GE(covered, runs * 85 / 100);
    EXPECT_GT(error, 0.1) << "one number is drawn per iteration: " << groups << " groups tell the variance to 14 to 23 %";
    EXPECT_LT(error, 0.3);
}

TEST(NoiseEstimate, PixelsThatFewSamplesLightAreNotTakenForDarkOrCertain) {
    // Light of mean 1 in one sample of 40: at 48 iterations, a third of the pixels is still black.
    const auto rare = [](size_t, double, Rng& rng) { return rng.uniform_double() < 1.0 / 40 ? 40.0 : 0.0; };
    const Accumulation sums = render(24, 9, rare);
    const auto noise = sums.noise();
    ASSERT_TRUE(noise.has_value());
    const double truth = 39 / double(sums.iterations()) / 1.01;
    EXPECT_NEAR(noise->relmse / truth, 1, 0.25);
    // The pixel's own value as the denominator would say far less.
    const RgbImage image = sums.develop(), variance = sums.variance();
    double naive = 0;
    for (size_t k = 0; k < image.pixels.size(); ++k)
        naive += variance.pixels[k] / (image.pixels[k] * image.pixels[k] + 0.01) / double(image.pixels.size());
    EXPECT_LT(naive, 0.7 * truth);
}

TEST(NoiseEstimate, ASpikeOfOneSampleCountsInFullAndTheConfidenceSaysThatItIsOne) {
    // One sample of one pixel in the last but one group is a thousand times as bright as all others.
    const Accumulation sums = render(24, 4, [n = 0](size_t, double, Rng& rng) mutable {
        return (++n == 40 * 48 * 32 * 3 + 2000 ? 1000.0 : 1.0) * (0.9 + 0.2 * rng.uniform_double());
    });
    const auto noise = sums.noise();
    ASSERT_TRUE(noise.has_value());
    const double truth = true_relmse(sums.develop(), [](size_t) { return 1.0; });
    EXPECT_NEAR(noise->relmse / truth, 1, 0.35);
    EXPECT_GT(noise->error, 0.9 * noise->relmse);
}

TEST(NoiseEstimate, ASmallLampInTheDarkIsNotTakenForASpike) {
    const auto lamp = [](size_t k) { return k / 3 == 700 ? 1000.0 : 0.01; };
    const Accumulation sums = render(24, 5, [&](size_t k, double, Rng& rng) { return lamp(k) * (0.5 + rng.uniform_double()); });
    const auto noise = sums.noise();
    ASSERT_TRUE(noise.has_value());
    EXPECT_NEAR(noise->relmse / true_relmse(sums.develop(), lamp), 1, 0.5);
}

TEST(NoiseEstimate, IsThatOfTheDevelopedPixels) {
    const auto half = [](size_t k, double, Rng& rng) { return scene(k) * rng.uniform_double(); };
    const auto twice = [](size_t k, double, Rng& rng) { return 4 * scene(k) * rng.uniform_double(); };
    FilmResponse exposed;
    exposed.exposure = 4;
    const auto a = render(16, 3, half, exposed).noise(), b = render(16, 3, twice).noise();
    ASSERT_TRUE(a && b);
    EXPECT_NEAR(a->relmse / b->relmse, 1, 1e-9);
    EXPECT_NEAR(a->error / b->error, 1, 1e-9);
    exposed.exposure = 0;
    const auto dark = render(16, 3, half, exposed).noise();
    EXPECT_EQ(dark->relmse, 0);
    EXPECT_EQ(dark->error, 0);
}

TEST(NoiseEstimate, NeedsTwoGroups) {
    const auto draw = [](size_t k, double, Rng& rng) { return scene(k) * rng.uniform_double(); };
    EXPECT_FALSE(render(0, 1, draw).noise().has_value());
    EXPECT_FALSE(render(1, 1, draw).noise().has_value());
    const auto two = render(2, 1, draw).noise();
    ASSERT_TRUE(two.has_value());
    EXPECT_GT(two->relmse, 0);
    EXPECT_NEAR(two->error / two->relmse, std::sqrt(2.0), 1e-12) << "one degree of freedom";
}

TEST(NoiseEstimate, EqualGroupsHaveNoNoise) {
    const auto noise = render(12, 1, [](size_t k, double, Rng&) { return scene(k); }).noise();
    ASSERT_TRUE(noise.has_value());
    EXPECT_NEAR(noise->relmse, 0, 1e-20);
    EXPECT_NEAR(noise->error, 0, 1e-20);
    const auto black = render(12, 1, [](size_t, double, Rng&) { return 0.0; }).noise();
    EXPECT_EQ(black->relmse, 0);
    EXPECT_EQ(black->error, 0);
}

TEST(NoiseEstimate, ReachesATargetWithItsStandardErrorAndEightGroups) {
    NoiseEstimate noise{.relmse = 0.009, .error = 0.0009, .groups = 8};
    EXPECT_TRUE(noise.reaches(0.01));
    noise.error = 0.0011;
    EXPECT_FALSE(noise.reaches(0.01));
    EXPECT_FALSE((NoiseEstimate{.relmse = 0, .error = 0, .groups = 7}.reaches(0.01)));
}

TEST(NoiseEstimate, IsMadeAtNumbersOfGroupsThatThePlanGives) {
    // `iterations` of group g, by number from 1 on.
    const auto numbers = [](uint32_t groups, const std::function<uint64_t(uint32_t)>& iterations) {
        std::vector<uint32_t> due;
        uint64_t done = 0, last = 0;
        for (uint32_t g = 1; g <= groups; ++g) {
            done += iterations(g);
            if (!NoiseEstimate::is_due(g, done, last)) continue;
            due.push_back(g);
            last = done;
        }
        return due;
    };
    const std::vector<uint32_t> first{2, 4, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20};
    const auto with = [&](std::vector<uint32_t> more) {
        more.insert(more.begin(), first.begin(), first.end());
        return more;
    };
    EXPECT_EQ(numbers(39, [](uint32_t) { return 1; }), with({22, 24, 26, 28, 30, 33, 36, 39}));
    EXPECT_EQ(numbers(20, [](uint32_t g) { return g; }), first);
    EXPECT_EQ(numbers(26, [](uint32_t g) { return g <= 20 ? 50 : 1000; }), with({21, 22, 23, 24, 25, 26}))
        << "a tenth of the samples";
}

TEST(NoiseEstimate, FramesSmallerThanTheWindow) {
    const double moment[] = {1, 1, 1};
    const auto mean = [](int, double* values) { values[0] = 1, values[1] = 2, values[2] = 3; };
    EXPECT_NEAR(relative_variance(mean, moment, 1, 1, 0.5, 0.01), 0.5 * (1 / 1.01 + 1 / 4.01 + 1 / 9.01) / 3, 1e-12);
}

}  // namespace
}  // namespace lightloom
