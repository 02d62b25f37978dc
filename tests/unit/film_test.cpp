// The exact accumulation: sums of partials, and groups of them.

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "common/film/accumulation.h"
#include "common/film/grouped_sum.h"
#include "tests/unit/film_testing.h"

namespace lightloom {
namespace {

using testing::four_tiles;
using testing::kFrame;
using testing::kInfinity;
using testing::kNan;
using testing::random_partial;

RgbImage develop_in_order(const std::vector<Partial>& partials, const std::vector<size_t>& order) {
    GroupSum group(kFrame);
    for (size_t i : order) EXPECT_TRUE(group.add(partials[i]).ok());
    Accumulation total(kFrame);
    EXPECT_TRUE(total.fold(group, 4).ok());
    return total.develop();
}

TEST(Accumulation, OrderOfArrivalDoesNotMatter) {
    std::vector<Partial> partials;
    for (const Rect& tile : four_tiles(kFrame.crop)) {
        // Magnitudes that make double addition depend on the order.
        partials.push_back(random_partial(kFrame, tile, partials.size(), 300, std::pow(1e5, double(partials.size()))));
    }
    std::vector<size_t> order{0, 1, 2, 3};
    const RgbImage first = develop_in_order(partials, order);
    while (std::next_permutation(order.begin(), order.end())) {
        EXPECT_EQ(develop_in_order(partials, order).pixels, first.pixels);
    }
}

TEST(Accumulation, DevelopsSumsOverCounts) {
    const FrameLayout frame{2, 1, {0, 0, 2, 1}};
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 2;
    p.camera = {2, 4, 6, 8, 10, 12};
    p.light_paths = 8;
    p.splats = {{1, {16, 0, 8}}};
    GroupSum group(frame);
    ASSERT_TRUE(group.add(p).ok());
    Accumulation total(frame);
    ASSERT_TRUE(total.fold(group, 2).ok());
    EXPECT_EQ(total.develop().pixels, (std::vector<float>{1, 2, 3, 4 + 2, 5, 6 + 1}));
    EXPECT_EQ(total.iterations(), 2u);
    EXPECT_TRUE(total.variance().pixels.empty()) << "one group says nothing of it";
}

TEST(Accumulation, VarianceComesFromGroupImages) {
    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    Accumulation total(frame);
    // Groups of 1, 1 and 2 iterations whose images are 1, 3 and 5: mean 3.5, sum n (X - mean)^2 = 6.25 + 0.25 + 4.5.
    for (const auto& [n, value] : {std::pair<uint32_t, double>{1, 1}, {1, 3}, {2, 5}}) {
        Partial p;
        p.tile = frame.crop;
        p.samples_per_pixel = n;
        p.camera = {n * value, 0, 0};
        GroupSum group(frame);
        ASSERT_TRUE(group.add(p).ok());
        ASSERT_TRUE(total.fold(group, n).ok());
    }
    EXPECT_FLOAT_EQ(total.develop().pixels[0], 3.5f);
    EXPECT_FLOAT_EQ(total.variance().pixels[0], 11.0f / (2 * 4));
}

TEST(Accumulation, DevelopsAsTheFilmResponds) {
    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    // Green takes half of red and blue, which varies with red: the variance of the sum is not the sum of variances.
    const FilmResponse response{2, {{{1, 0, 0}, {0.5, 0, 0.5}, {0, 0.25, 1}}}};
    Accumulation total(frame, response), green(frame), neutral(frame, {2, FilmResponse::kNeutral});
    for (const auto& [r, b] : {std::pair<double, double>{1, 2}, {3, 6}, {5, 4}}) {
        const auto fold = [&](Accumulation* to, std::vector<double> camera) {
            Partial p;
            p.tile = frame.crop;
            p.samples_per_pixel = 1;
            p.camera = std::move(camera);
            GroupSum group(frame);
            ASSERT_TRUE(group.add(p).ok());
            ASSERT_TRUE(to->fold(group, 1).ok());
        };
        fold(&total, {r, 8, b});
        fold(&neutral, {r, 8, b});
        fold(&green, {0, r + b, 0});
    }
    EXPECT_EQ(total.develop().pixels, (std::vector<float>{6, 7, 12}));
    EXPECT_EQ(neutral.develop().pixels, (std::vector<float>{6, 16, 8}));
    EXPECT_FLOAT_EQ(total.variance().pixels[0], 4 * 8.0f / (2 * 3));
    EXPECT_FLOAT_EQ(total.variance().pixels[1], green.variance().pixels[1]);
    EXPECT_FLOAT_EQ(neutral.variance().pixels[0], total.variance().pixels[0]);
}

TEST(Accumulation, ScalesWithTheLights) {
    for (const double factor : {1e6, 1e-6}) {
        GroupSum plain(kFrame), scaled(kFrame);
        for (const Rect& tile : four_tiles(kFrame.crop)) {
            Partial p = random_partial(kFrame, tile, 5, 200, 0.25);
            ASSERT_TRUE(plain.add(p).ok());
            for (double& v : p.camera) v *= factor;
            for (SplatSum& s : p.splats) {
                for (double& v : s.rgb) v *= factor;
            }
            ASSERT_TRUE(scaled.add(p).ok());
        }
        Accumulation a(kFrame), b(kFrame);
        ASSERT_TRUE(a.fold(plain, 4).ok());
        ASSERT_TRUE(b.fold(scaled, 4).ok());
        const RgbImage x = a.develop(), y = b.develop();
        for (size_t i = 0; i < x.pixels.size(); ++i) {
            if (x.pixels[i] > 0.05f) {
                ASSERT_NEAR(y.pixels[i] / (x.pixels[i] * factor), 1, 1e-6) << factor << " " << i;
            }
        }
    }
}

TEST(Accumulation, RefusesNonFiniteAndAddsNothing) {
    for (const double bad : {kNan, kInfinity, -kInfinity, 1e26, -1e300}) {
        for (const bool splat : {false, true}) {
            GroupSum group(kFrame);
            Partial good = random_partial(kFrame, kFrame.crop, 1, 10);
            Partial p = good;
            (splat ? p.splats.back().rgb[2] : p.camera.back()) = bad;
            EXPECT_EQ(group.add(p).code(), StatusCode::kDataLoss);
            ASSERT_TRUE(group.add(good).ok());
            Accumulation total(kFrame);
            EXPECT_TRUE(total.fold(group, 4).ok());
        }
    }
}

TEST(Accumulation, RefusesSumsBeyondTheRange) {
    const FrameLayout frame{2, 1, {0, 0, 2, 1}};
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 1;
    p.camera = {9e24, 0, 0, 1, 1, 1};
    GroupSum group(frame);
    ASSERT_TRUE(group.add(p).ok());
    EXPECT_EQ(group.add(p).code(), StatusCode::kDataLoss);
    p.camera = {-9e24, 0, 0, 0, 9e24, 0};  // Fits, although the bounds alone could not tell.
    ASSERT_TRUE(group.add(p).ok());
    Accumulation total(frame);
    ASSERT_TRUE(total.fold(group, 2).ok());
    EXPECT_EQ(total.develop().pixels[0], 0.0f);
    EXPECT_FLOAT_EQ(total.develop().pixels[4], 4.5e24f);
}

TEST(Accumulation, FoldsOnlyCompleteGroups) {
    GroupSum group(kFrame);
    const std::vector<Rect> tiles = four_tiles(kFrame.crop);
    for (size_t i = 0; i < 3; ++i) ASSERT_TRUE(group.add(random_partial(kFrame, tiles[i], i, 10)).ok());
    Accumulation total(kFrame);
    EXPECT_EQ(total.fold(group, 4).code(), StatusCode::kFailedPrecondition);
    ASSERT_TRUE(group.add(random_partial(kFrame, tiles[3], 3, 10)).ok());
    EXPECT_EQ(total.fold(group, 5).code(), StatusCode::kFailedPrecondition);
    EXPECT_TRUE(total.fold(group, 4).ok());
    EXPECT_EQ(total.dropped(), 80u);
    group.clear();
    EXPECT_EQ(total.fold(group, 4).code(), StatusCode::kFailedPrecondition) << "nothing is left of it";
    // As many pixels as the frame has, but not all of them.
    for (const size_t i : {0, 1, 2, 2}) ASSERT_TRUE(group.add(random_partial(kFrame, tiles[i], i, 10)).ok());
    EXPECT_EQ(total.fold(group, 4).code(), StatusCode::kFailedPrecondition);
    // Samples may come in parts.
    group.clear();
    for (int part = 0; part < 2; ++part)
        for (const Rect& tile : tiles) ASSERT_TRUE(group.add(random_partial(kFrame, tile, 5, 10)).ok());
    EXPECT_TRUE(total.fold(group, 8).ok());
}

/// Partials of a whole group of kFrame; `seed` tells groups apart.
std::vector<Partial> group_of(uint64_t seed) {
    std::vector<Partial> partials;
    for (const Rect& tile : four_tiles(kFrame.crop))
        partials.push_back(random_partial(kFrame, tile, 10 * seed + partials.size(), 50));
    return partials;
}

/// Mutation: GroupedSum::add() that counts before it adds fails this.
TEST(GroupedSum, ARefusedUnitLeavesTheSumsAsTheyWere) {
    for (const double bad : {kNan, 1e26}) {
        GroupedSum plain(kFrame), tried(kFrame);
        for (const Partial& partial : group_of(1)) {
            Partial broken = partial;
            broken.camera.back() = bad;
            EXPECT_EQ(tried.add(broken).code(), StatusCode::kDataLoss);
            broken = partial;
            broken.splats.back().rgb[0] = bad;
            EXPECT_EQ(tried.add(broken).code(), StatusCode::kDataLoss);
            EXPECT_EQ(tried.current_units(), plain.current_units());
            ASSERT_TRUE(plain.add(partial).ok());
            ASSERT_TRUE(tried.add(partial).ok());
        }
        ASSERT_TRUE(plain.fold(4).ok());
        ASSERT_TRUE(tried.fold(4).ok());
        EXPECT_EQ(tried.complete().develop().pixels, plain.complete().develop().pixels);
        EXPECT_EQ(tried.complete().dropped(), plain.complete().dropped());
        EXPECT_EQ(tried.counters().rays, plain.counters().rays);
    }
}

TEST(GroupedSum, OnlyCompleteGroupsAreSeen) {
    GroupedSum sums(kFrame);
    EXPECT_EQ(sums.fold(4).code(), StatusCode::kFailedPrecondition) << "no unit yet";
    Accumulation all(kFrame);
    GroupSum folded(kFrame);
    uint64_t rays = 0;
    for (uint32_t g = 0; g < 3; ++g) {
        GroupSum alone(kFrame);
        for (const Partial& partial : group_of(g)) {
            ASSERT_TRUE(sums.add(partial).ok());
            ASSERT_TRUE(alone.add(partial).ok());
            EXPECT_EQ(sums.complete().develop().pixels, all.develop().pixels) << "a unit of a group that is not complete";
            EXPECT_EQ(sums.complete().dropped(), 80u * g);
            EXPECT_EQ(sums.counters().rays, rays);
        }
        EXPECT_EQ(sums.current_units(), 4u);
        for (const Partial& partial : group_of(g)) rays += partial.counters.rays;
        ASSERT_TRUE(sums.fold(4, &folded).ok());
        ASSERT_TRUE(all.fold(alone, 4).ok());
        EXPECT_EQ(sums.current_units(), 0u);
        EXPECT_EQ(sums.counters().rays, rays);
        EXPECT_EQ(sums.complete().group_count(), g + 1);
        EXPECT_EQ(sums.complete().develop().pixels, all.develop().pixels);
        // What is given back are this group's own sums.
        Accumulation one(kFrame), other(kFrame);
        ASSERT_TRUE(one.fold(folded, 4).ok());
        ASSERT_TRUE(other.fold(alone, 4).ok());
        EXPECT_EQ(one.develop().pixels, other.develop().pixels);
    }
    EXPECT_EQ(sums.complete().variance().pixels, all.variance().pixels);
}

/// A group that lacks a unit, has one twice, or leaves the range only together with the others.
TEST(GroupedSum, AGroupThatDoesNotFitIsNoPartOfTheImage) {
    GroupedSum sums(kFrame);
    const std::vector<Partial> units = group_of(1);
    for (const Partial& partial : units) ASSERT_TRUE(sums.add(partial).ok());
    ASSERT_TRUE(sums.fold(4).ok());
    const RgbImage before = sums.complete().develop();
    const uint64_t rays = sums.counters().rays;
    const auto unchanged = [&] {
        EXPECT_EQ(sums.complete().group_count(), 1u);
        EXPECT_EQ(sums.complete().develop().pixels, before.pixels);
        EXPECT_EQ(sums.counters().rays, rays);
    };
    ASSERT_TRUE(sums.add(units[0]).ok());
    EXPECT_EQ(sums.fold(4).code(), StatusCode::kFailedPrecondition);
    unchanged();
    sums.drop_current();
    EXPECT_EQ(sums.current_units(), 0u);
    for (const Partial& partial : units) ASSERT_TRUE(sums.add(partial).ok());
    ASSERT_TRUE(sums.add(units[0]).ok()) << "exactly-once is the caller's duty";
    EXPECT_EQ(sums.fold(4).code(), StatusCode::kFailedPrecondition);
    unchanged();

    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    GroupedSum bright(frame);
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 1;
    p.camera = {9e24, 0, 0};
    ASSERT_TRUE(bright.add(p).ok());
    ASSERT_TRUE(bright.fold(1).ok());
    ASSERT_TRUE(bright.add(p).ok());
    EXPECT_EQ(bright.fold(1).code(), StatusCode::kDataLoss);
    EXPECT_EQ(bright.complete().iterations(), 1u);
}

TEST(FixedSums, EqualPlain128BitSums) {
    Rng rng({99});
    FixedSums sums(3), all(3);
    __int128 plain[3] = {};
    for (int round = 0; round < 100000; ++round) {
        // All magnitudes from below a step to far beyond 64 bits, both signs, so that borrows and carries occur.
        double values[3], largest = 0;
        const int top = int(rng.below(130)) - 50;
        for (double& v : values) {
            v = std::ldexp(rng.uniform_double() - 0.5, top - int(rng.below(30)));
            largest = std::max(largest, std::fabs(v));
        }
        if (round % 1000 == 0) values[0] = 0.5 * 0x1p-44, values[1] = 1.5 * 0x1p-44, values[2] = -2.5 * 0x1p-44;
        sums.add(0, values, 3, std::max(largest, 1e-12));
        for (int i = 0; i < 3; ++i) {
            // Rounding to nearest even by the remainder, in wide arithmetic of its own.
            const double steps = std::ldexp(values[i], 44), whole = std::floor(steps), rest = steps - whole;
            __int128 rounded = __int128(whole);
            if (rest > 0.5 || (rest == 0.5 && (rounded & 1))) rounded += 1;
            plain[i] += rounded;
            ASSERT_TRUE(sums.steps(size_t(i)) == plain[i]) << round;
        }
    }
    all.add(sums, 0, 3);
    all.add(sums, 0, 3);
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_TRUE(all.steps(i) == 2 * plain[i]);
        EXPECT_EQ(all.value(i), double(2 * plain[i]) * 0x1p-44);
    }
}

/// Many sums, of which only some have ever had more than 64 bits.
TEST(FixedSums, UpperWordsComeWhereTheyAreNeededAndGo) {
    constexpr size_t kCount = 3000;
    FixedSums sums(kCount), other(kCount), empty(kCount);
    EXPECT_TRUE(sums.empty());
    EXPECT_EQ(sums.value(7), 0);
    std::vector<Int128> expected(kCount), expected_other(kCount);
    Rng rng({9});
    for (int round = 0; round < 40; ++round) {
        std::vector<double> values(kCount);
        for (double& v : values)
            v = std::ldexp(rng.uniform_double() - (round < 20 ? 0 : 0.5), round % 2 == 0 ? 18 : int(rng.below(70)));
        const double largest = std::fabs(
            *std::max_element(values.begin(), values.end(), [](double a, double b) { return std::fabs(a) < std::fabs(b); }));
        sums.add(0, values.data(), kCount, largest);
        other.add(0, values.data(), kCount / 2, largest);
        for (size_t i = 0; i < kCount; ++i) expected[i] += FixedSums::to_steps(values[i]);
        for (size_t i = 0; i < kCount / 2; ++i) expected_other[i] += FixedSums::to_steps(values[i]);
    }
    for (size_t i = 0; i < kCount; ++i) ASSERT_TRUE(sums.steps(i) == expected[i] && other.steps(i) == expected_other[i]) << i;
    sums.add(other, 0, kCount);
    sums.add(empty, 0, kCount);
    for (size_t i = 0; i < kCount; ++i) {
        ASSERT_TRUE(sums.steps(i) == expected[i] + expected_other[i]) << i;
        ASSERT_EQ(sums.value(i), std::ldexp(double(expected[i] + expected_other[i]), -44)) << i;
    }
    sums.clear();
    for (size_t i = 0; i < kCount; ++i) ASSERT_TRUE(sums.steps(i) == 0) << i;
}

}  // namespace
}  // namespace lightloom
