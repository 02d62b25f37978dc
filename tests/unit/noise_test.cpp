// Gradient noise and what procedural textures make of it.

#include "common/scene/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/core/rng.h"

namespace lightloom {
namespace {

Vec3 random_place(Rng* rng, float extent) {
    const auto u = [&] { return (2 * rng->uniform() - 1) * extent; };
    const float x = u(), y = u();
    return {x, y, u()};
}

TEST(Noise, HasTheValuesOfItsDefinition) {
    // In double, from the permutation, sixteen gradients written out as vectors, and the weights 6 t^5 - 15 t^4 + 10 t^3.
    const struct {
        Vec3 p;
        float value;
    } kValues[] = {
        {{0.5f, 0.5f, 0.5f}, -0.1250000f},
        {{1.25f, 2.5f, 3.75f}, -0.0383635f},
        {{-0.3f, 7.1f, -12.6f}, -0.0003018f},
        {{100.2f, -50.7f, 255.9f}, 0.2749278f},
        {{3.5f, 0.5f, 0.5f}, -0.1250000f},
        {{255.5f, 255.5f, 255.5f}, -0.3750000f},
        {{-1000.125f, 0.375f, 600.5f}, -0.4212564f},
        {{17.75f, 3.5f, -0.0625f}, -0.0762484f},
        {{0.1f, 0.2f, 0.3f}, 0.3587210f},
        {{42.42f, 13.37f, 9.81f}, -0.4418415f},
    };
    for (const auto& c : kValues) EXPECT_NEAR(noise(c.p), c.value, 2e-5f) << c.p.x;
}

TEST(Noise, IsZeroAtWholeCoordinatesPeriodicAndContinuous) {
    Rng rng({3});
    for (int i = 0; i < 10000; ++i) {
        const Vec3 p = random_place(&rng, 100);
        EXPECT_EQ(noise({std::floor(p.x), std::floor(p.y), std::floor(p.z)}), 0);
        const Vec3 q{float(int(p.x * 64)) / 64, float(int(p.y * 64)) / 64, float(int(p.z * 64)) / 64};  // Exact after the shift.
        EXPECT_EQ(noise(q), noise(q + Vec3{256, -512, 1024}));
        EXPECT_NEAR(noise(p), noise(p + Vec3{1e-4f, -1e-4f, 1e-4f}), 1e-3f);
    }
    EXPECT_EQ(noise({1e30f, 0.5f, 0.5f}), noise({0, 0.5f, 0.5f}));
    EXPECT_EQ(noise({INFINITY, 0, 0}), 0);
    EXPECT_EQ(noise({0, NAN, 0}), 0);
}

TEST(Noise, StaysWithinItsBound) {
    // What any gradients could give, on a grid over the distinct part of a cell.
    const auto weight = [](double t) { return t * t * t * (t * (t * 6 - 15) + 10); };
    double most = 0;
    constexpr int kSteps = 48;
    for (int a = 0; a <= kSteps; ++a)
        for (int b = a; b <= kSteps; ++b)
            for (int c = b; c <= kSteps; ++c) {
                const double at[3] = {0.5 * a / kSteps, 0.5 * b / kSteps, 0.5 * c / kSteps};
                double sum = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    double w = 1, total = 0, least = 1;
                    for (int i = 0; i < 3; ++i) {
                        const bool far = ((corner >> i) & 1) != 0;
                        const double d = far ? 1 - at[i] : at[i];
                        w *= far ? weight(at[i]) : 1 - weight(at[i]);
                        total += d, least = std::min(least, d);
                    }
                    sum += w * (total - least);
                }
                most = std::max(most, sum);
            }
    EXPECT_GT(most, 1.036);
    EXPECT_LT(most, 1.0365);
    EXPECT_LT(most, double(kNoiseBound));
    Rng rng({5});
    float seen = 0;
    for (int i = 0; i < 300000; ++i) seen = std::max(seen, std::fabs(noise(random_place(&rng, 200))));
    EXPECT_LE(seen, kNoiseBound);
    EXPECT_GT(seen, 0.8f);
}

TEST(Noise, OctavesAddUp) {
    Rng rng({7});
    for (int i = 0; i < 1000; ++i) {
        const Vec3 p = random_place(&rng, 10);
        const float omega = rng.uniform();
        const int octaves = int(rng.uniform() * 8);
        double sum = 0, magnitudes = 0, amplitude = 1;
        Vec3 q = p;
        for (int k = 0; k < octaves; ++k) {
            const double n = double(noise(q));
            sum += amplitude * n, magnitudes += amplitude * std::fabs(n);
            amplitude *= double(omega);
            q = p * float(std::pow(1.99, k + 1));
        }
        // The frequencies are rounded differently, by 10^-7 of places up to 10 1.99^7.
        EXPECT_NEAR(double(fractal_noise(p, omega, octaves)), sum, 2e-3);
        EXPECT_NEAR(double(turbulence(p, omega, octaves)), magnitudes + 0.2 * amplitude, 2e-3);
    }
    EXPECT_EQ(fractal_noise({0.5f, 0.5f, 0.5f}, 0.5f, 0), 0);
    EXPECT_EQ(turbulence({0.5f, 0.5f, 0.5f}, 0.5f, 0), 0.2f);
}

TEST(Dots, LieWhereNoisePutsThem) {
    // Rows t = -3 ... 3, columns s = -3 ... 3: whether the cell has one, by the same independent evaluation.
    constexpr int kCells[7][7] = {{0, 0, 0, 1, 0, 0, 0}, {1, 1, 0, 0, 1, 1, 0}, {0, 0, 1, 0, 1, 1, 0}, {0, 0, 0, 0, 0, 0, 0},
                                  {1, 0, 0, 1, 0, 0, 0}, {0, 0, 1, 1, 1, 1, 1}, {0, 0, 0, 1, 1, 1, 1}};
    for (int t = -3; t <= 3; ++t)
        for (int s = -3; s <= 3; ++s) {
            // A dot holds its cell's centre wherever it is moved to.
            EXPECT_EQ(inside_dot({float(s), float(t)}), kCells[t + 3][s + 3] != 0) << s << ' ' << t;
            EXPECT_FALSE(inside_dot({float(s) + 0.5f, float(t) + 0.5f}));
        }
    // That of cell (1, 2) has its centre at (1.1131516, 2.0119016).
    EXPECT_TRUE(inside_dot({1.1131516f + 0.349f, 2.0119016f}));
    EXPECT_FALSE(inside_dot({1.1131516f + 0.351f, 2.0119016f}));
    EXPECT_TRUE(inside_dot({1.1131516f, 2.0119016f - 0.349f}));
    EXPECT_FALSE(inside_dot({1.1131516f, 2.0119016f - 0.351f}));
    EXPECT_FALSE(inside_dot({INFINITY, NAN}));
}

TEST(Marble, IsASplineOfPbrtsColours) {
    const double kColours[9][3] = {{.58, .58, .6}, {.58, .58, .6}, {.58, .58, .6}, {.5, .5, .5},  {.6, .59, .58},
                                   {.58, .58, .6}, {.58, .58, .6}, {.2, .2, .33},  {.58, .58, .6}};
    Rng rng({9});
    for (int i = 0; i < 5000; ++i) {
        const Vec3 p = random_place(&rng, 20);
        const double at = 0.5 + 0.5 * std::sin(double(p.y) + 0.7 * double(fractal_noise(p, 0.5f, 4)));
        const int first = std::min(int(at * 6), 5);
        const double t = at * 6 - first;
        const Rgb value = marble(p, 0.5f, 4, 0.7f);
        for (int c = 0; c < 3; ++c) {
            double b[4];
            for (int k = 0; k < 4; ++k) b[k] = kColours[first + k][c];
            for (int n = 3; n > 0; --n)  // de Casteljau
                for (int k = 0; k < n; ++k) b[k] += t * (b[k + 1] - b[k]);
            EXPECT_NEAR(double(value[c]), 1.5 * b[0], 1e-5);
        }
    }
    for (const float y : {1e9f, -1e15f, 1e30f, INFINITY, NAN}) {
        const Rgb value = marble({0, y, 0}, 0.5f, 4, 1e20f);
        for (int c = 0; c < 3; ++c) EXPECT_TRUE(value[c] >= 0.299f && value[c] <= 0.901f) << y;
    }
}

}  // namespace
}  // namespace lightloom
