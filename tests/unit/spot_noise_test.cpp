// A narrow spot on a wall, lit directly: next event estimation from the first hit is all but free of noise, and no other technique
// may add its own to it.

#include <gtest/gtest.h>

#include <cmath>

#include "common/core/math.h"
#include "tests/support/estimates.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

constexpr int kSeeds = 8;
constexpr uint32_t kSamples = 16;

std::shared_ptr<const Scene> spot_on_a_wall() {
    testing::SceneBuilder b;
    b.description().film.width = b.description().film.height = 48;
    b.quad({-9, -9, 2}, {18, 0, 0}, {0, 18, 0}, b.diffuse(Rgb(0.5f)));
    SpotLight spot;
    spot.position = {0.5f, 0.2f, 0};
    spot.axes = Frame(normalize(Vec3{-0.5f, -0.2f, 2}));
    spot.intensity = Rgb(10.0f);
    spot.total_height = float(1 - math::cos(6 * kPiD / 180)), spot.falloff_height = float(1 - math::cos(4 * kPiD / 180));
    b.description().spot_lights.push_back(spot);
    b.look({0, 0, 0}, {0, 0, 1}, 70);
    return b.build();
}

/// Mean over the lit pixels of the variance between seeds.
double variance_in_the_spot(const testing::ImageOfSeed& image) {
    std::vector<double> sum, square;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
        const std::vector<double> pixels = image(seed);
        sum.resize(pixels.size()), square.resize(pixels.size());
        for (size_t i = 0; i < pixels.size(); ++i) sum[i] += pixels[i], square[i] += pixels[i] * pixels[i];
    }
    double total = 0;
    int lit = 0;
    for (size_t i = 0; i < sum.size(); ++i) {
        if (!(sum[i] > 0.5 * *std::max_element(sum.begin(), sum.end()))) continue;
        total += square[i] / kSeeds - (sum[i] / kSeeds) * (sum[i] / kSeeds);
        ++lit;
    }
    EXPECT_GT(lit, 10);
    return total / lit;
}

/// Mutations: NextEventRays::trust() := 1; lvcbpt or spcbpt without next event estimation.
TEST(NarrowSpot, IsNoNoisierThanWithPathTracing) {
    const auto scene = spot_on_a_wall();
    const double path = variance_in_the_spot(testing::catalog_image(scene, "path", 1, kSamples));
    EXPECT_GT(path, 0);
    for (const char* algorithm : {"bdpt", "lvcbpt", "spcbpt"})
        EXPECT_LT(variance_in_the_spot(testing::catalog_image(scene, algorithm, 1, kSamples)), 1.25 * path) << algorithm;
    // Several rays at the first hit do not make it worse.
    EXPECT_LT(variance_in_the_spot(testing::catalog_image(scene, "bdpt", 1, kSamples, {{"next-event", "4"}})), 1.25 * path);
}

}  // namespace
}  // namespace lightloom
