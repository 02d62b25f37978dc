// The shared samplers: equal-area octahedral mapping, alias table, low-discrepancy points.

#include "common/scene/sampling.h"

#include <gtest/gtest.h>

#include "common/core/inverse_cdf.h"
#include "common/core/low_discrepancy.h"
#include "tests/support/statistics.h"

namespace lightloom {
namespace {

TEST(EqualAreaMapping, RoundTrips) {
    Rng rng({1, Stage::kTraining, 0, 0});
    for (int i = 0; i < 20000; ++i) {
        const Vec2 p = rng.uniform2();
        const Vec3 d = equal_area_square_to_sphere(p);
        EXPECT_NEAR(length(d), 1, 1e-6f);
        const Vec2 q = equal_area_sphere_to_square(d);
        EXPECT_NEAR(p.x, q.x, 1e-5f);
        EXPECT_NEAR(p.y, q.y, 1e-5f);
        const Vec3 e = equal_area_square_to_sphere(equal_area_sphere_to_square(sample_sphere(p)));
        EXPECT_LT(length(e - sample_sphere(p)), 1e-5f);
    }
}

/// Solid angle of the image of a small square, by the cross product of central differences, against
/// 4 pi dx dy. Squares on the creases of the mapping are left out.
TEST(EqualAreaMapping, HasTheSameJacobianEverywhere) {
    const float h = 1e-3f;
    const int n = 61;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const Vec2 p{(float(i) + 0.37f) / float(n), (float(j) + 0.61f) / float(n)};
            const float u = std::fabs(2 * p.x - 1), v = std::fabs(2 * p.y - 1);
            if (u < 0.01f || v < 0.01f || std::fabs(u + v - 1) < 0.01f) continue;
            const Vec3 dx = equal_area_square_to_sphere({p.x + h, p.y}) - equal_area_square_to_sphere({p.x - h, p.y});
            const Vec3 dy = equal_area_square_to_sphere({p.x, p.y + h}) - equal_area_square_to_sphere({p.x, p.y - h});
            EXPECT_NEAR(length(cross(dx, dy)) / (4 * h * h), 4 * kPi, 0.02f * 4 * kPi) << p.x << " " << p.y;
        }
}

TEST(AliasTable, DrawsItsOwnPmfAndLeavesFreshUniforms) {
    testing::TestFamily family;
    const std::vector<std::vector<double>> tables = {{1}, {1, 1}, {0, 3, 1}, {5, 0, 0, 1e-3, 2, 2, 0}, {0, 0, 0}};
    for (const std::vector<double>& weights : tables) {
        const AliasTable table(weights);
        double total = 0, weight_sum = 0;
        for (size_t i = 0; i < weights.size(); ++i) total += double(table.pmf(i)), weight_sum += weights[i];
        EXPECT_NEAR(total, 1, 1e-6);
        const int n = 200000, bins = 16;
        std::vector<double> observed(weights.size() * bins), expected(weights.size() * bins);
        Rng rng({2, Stage::kTraining, 0, weights.size()});
        for (int i = 0; i < n; ++i) {
            float rest = 0;
            const uint32_t k = table.sample(rng.uniform_double(), &rest);
            ASSERT_LT(k, weights.size());
            ASSERT_TRUE(rest >= 0 && rest < 1);
            if (weight_sum > 0) {
                EXPECT_GT(weights[k], 0) << "drew an index of weight zero";
            }
            ++observed[k * bins + size_t(rest * bins)];
        }
        for (size_t k = 0; k < weights.size(); ++k)
            for (int b = 0; b < bins; ++b) expected[k * bins + size_t(b)] = double(table.pmf(k)) * n / bins;
        family.add(testing::chi_square_test(observed, expected).p_value, "table of " + std::to_string(weights.size()));
    }
    family.check();
}

TEST(InverseCdfTable, EveryOutcomeHasExactlyItsPartOfTheUnitInterval) {
    std::vector<float> spiky(1000, 1e-12f);
    spiky[0] = spiky[617] = 0.4f, spiky[999] = 0.2f;
    std::vector<float> gaps(1000, 0.0f);
    gaps[3] = gaps[4] = gaps[998] = 7;
    std::vector<float> slope;
    for (int i = 0; i < 1000; ++i) slope.push_back(float(i + 1));
    const std::vector<std::vector<float>> columns = {spiky, gaps, slope};
    InverseCdfTable table(1000, uint32_t(columns.size()));
    for (uint32_t c = 0; c < columns.size(); ++c) table.set(c, columns[c]);
    constexpr uint64_t one = uint64_t(1) << 31;
    std::vector<std::vector<uint32_t>> drawn(columns.size());
    for (uint32_t c = 0; c < columns.size(); ++c) {
        const InverseCdfTable::Column column = table.column(c);
        double total = 0;
        for (const float w : columns[c]) total += double(w);
        for (uint64_t begin = 0; begin < one;) {
            const InverseCdfTable::Draw first = column.draw(double(begin) / double(one));
            // Where the next outcome begins, by bisection.
            uint64_t inside = begin, end = one;
            while (end - inside > 1) {
                const uint64_t middle = (inside + end) / 2;
                (column.draw(double(middle) / double(one)).outcome > first.outcome ? end : inside) = middle;
            }
            EXPECT_EQ(first.rest, 0);
            EXPECT_LT(column.draw(std::nextafter(double(end) / double(one), 0.0)).rest, 1);
            EXPECT_FLOAT_EQ(first.probability, float(double(end - begin) / double(one)));
            EXPECT_NEAR(double(first.probability), double(columns[c][first.outcome]) / total, 1001 / double(one));
            drawn[c].push_back(first.outcome);
            begin = end;
        }
        std::vector<uint32_t> positive;
        for (uint32_t i = 0; i < 1000; ++i)
            if (columns[c][i] > 0) positive.push_back(i);
        EXPECT_EQ(drawn[c], positive);
    }
    for (uint32_t c = 0; c < columns.size(); ++c) {  // (u + n) / N may round to 1
        EXPECT_EQ(table.column(c).draw(1.0).outcome, drawn[c].back());
        EXPECT_LT(table.column(c).draw(1.0).rest, 1);
    }
    for (uint32_t c = 0; c < columns.size(); ++c) {
        InverseCdfTable::Draw strata[7];
        for (const double u : {0.0, 0.37, 1 - 0x1p-53}) {
            table.column(c).draw_strata(u, 7, strata);
            for (int n = 0; n < 7; ++n) {
                const InverseCdfTable::Draw alone = table.column(c).draw((u + n) / 7);
                EXPECT_EQ(strata[n].outcome, alone.outcome);
                EXPECT_EQ(strata[n].probability, alone.probability);
                EXPECT_EQ(strata[n].rest, alone.rest);
            }
        }
    }
    InverseCdfTable single(1, 1);
    single.set(0, std::vector<float>{3});
    EXPECT_EQ(single.column(0).draw(0.75).rest, 0.75);
}

/// Column j of Pascal's triangle modulo 2, row i at bit 31 - i, added up over the bits j of the index.
TEST(LowDiscrepancy, SecondDimensionIsThatOfSobol) {
    Rng rng({5, Stage::kTraining, 0, 0});
    for (int n = 0; n < 1000; ++n) {
        const uint32_t index = n < 100 ? uint32_t(n) : uint32_t(rng.next_u64());
        uint32_t column = 0x80000000u, expected = 0;
        for (int j = 0; j < 32; ++j, column ^= column >> 1)
            if (index >> j & 1) expected ^= column;
        ASSERT_EQ(reverse_bits(sobol_second_reversed(index)), expected) << index;
    }
}

/// 2^m consecutive points from a multiple of 2^m on: one in every elementary interval of area 2^-m.
TEST(LowDiscrepancy, EveryAlignedBlockIsStratified) {
    for (const uint64_t seed : {0ull, 1ull, 99ull, 1ull << 40})
        for (int m = 0; m <= 8; ++m)
            for (const uint32_t block : {0u, 1u, 5u, 1000u})
                for (int a = 0; a <= m; ++a) {
                    std::vector<int> count(size_t(1) << m, 0);
                    for (uint32_t i = 0; i < 1u << m; ++i) {
                        const Vec2 p = low_discrepancy_point((block << m) + i, seed);
                        ++count[(size_t(p.x * float(1 << a)) << (m - a)) + size_t(p.y * float(1 << (m - a)))];
                    }
                    for (const int c : count) ASSERT_EQ(c, 1) << "seed " << seed << ", block " << block << ", 2^" << m;
                }
}

/// Over seeds, every single point is uniform, and so is the pair of two points of one sequence's
/// neighbouring scrambles.
TEST(LowDiscrepancy, EveryPointIsUniformOverSeeds) {
    testing::TestFamily family;
    const int n = 100000, bins = 16;
    for (const uint32_t index : {0u, 1u, 2u, 77u, 123456u})
        for (const bool other : {false, true}) {
            std::vector<double> observed(size_t(bins * bins), 0);
            for (int s = 0; s < n; ++s) {
                const uint64_t seed = Rng({3, Stage::kPixelScramble, 0, uint64_t(s)}).next_u64();
                const Vec2 p = low_discrepancy_point(index, seed);
                const float y = other ? low_discrepancy_point(index, seed + 1).x : p.y;
                ++observed[size_t(p.x * bins) * bins + size_t(y * bins)];
            }
            const std::vector<double> expected(observed.size(), double(n) / double(observed.size()));
            family.add(testing::chi_square_test(observed, expected).p_value, "index " + std::to_string(index));
        }
    family.check();
}

}  // namespace
}  // namespace lightloom
