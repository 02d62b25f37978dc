// Lights whose strength an image gives: which way round it is, and that nothing of it is left out. Their densities and power are
// tested with those of all others (emitter_test).

#include "common/scene/light_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/core/math.h"
#include "common/core/rng.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

using testing::SceneBuilder;

/// Red, green, blue and white in the corners as one looks at the picture: top left, top right, bottom left, bottom right.
Image four_corners() {
    Image image;
    image.width = image.height = 2;
    image.floats = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
    return image;
}

/// As pbrt-v4 shows it: row 0 at v = 1, bilinear, and what is hit shines as what is sampled.
TEST(SurfaceMap, IsSeenAsThePictureIs) {
    SceneBuilder b;
    b.description().images.push_back(four_corners());
    const int32_t emission = b.emission(Rgb(2.0f));
    b.description().emissions[size_t(emission)].image = 0;
    // Seen from +z with y up, u to the right and v up.
    b.quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, b.diffuse(Rgb(0.0f)), emission).uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    const auto scene = b.build();
    const auto seen = [&](float x, float y) {
        SurfacePoint point;
        EXPECT_TRUE(scene->intersect({x, y, 3}, {0, 0, -1}, &point));
        const EmitterSet& emitters = scene->emitters();
        return emitters.emitted(emitters[uint32_t(point.emitter)], point.p, point.ng, {0, 0, 1});
    };
    EXPECT_EQ(seen(-0.9f, 0.9f), Rgb(2, 0, 0));
    EXPECT_EQ(seen(0.9f, 0.9f), Rgb(0, 2, 0));
    EXPECT_EQ(seen(-0.9f, -0.9f), Rgb(0, 0, 2));
    EXPECT_EQ(seen(0.9f, -0.9f), Rgb(2.0f));
    const Rgb top = seen(0, 0.9f);
    EXPECT_NEAR(top.r, 1, 1e-5f);
    EXPECT_NEAR(top.g, 1, 1e-5f);
    EXPECT_NEAR(top.b, 0, 1e-5f);
    Rng rng({1, Stage::kTraining, 0, 0});
    for (int i = 0; i < 1000; ++i) {
        NextEventSample light;
        const double pick = rng.uniform_double();
        if (!scene->emitters().sample_next_event({0.3f, -0.2f, 2}, pick, rng.uniform2(), &light)) continue;
        const Rgb hit = seen(light.position.x, light.position.y);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(light.radiance[c], hit[c], 1e-4f);
    }
}

/// However small the part of an image is that a triangle shows, and however far from where the rule looks: it is chosen.
TEST(SurfaceMap, NoPartIsForgotten) {
    Image image;
    image.width = image.height = 512;
    image.floats.assign(512 * 512, 0);
    image.channels = 1;
    image.floats[100 * 512 + 77] = 1;
    const Vec2 uv[3] = {{0, 0}, {1, 0}, {0, 1}};
    EXPECT_GT(SurfaceMap(image, image.mean(), uv).mean().g, 0);
}

/// As one would see the slide from the lamp: +x to the right, +y up, row 0 at the top.
TEST(DirectionMap, ProjectsThePictureUpright) {
    const Image image = four_corners();
    const DirectionMap map = DirectionMap::projection(image, translation(5, 6, 7) * scaling(3, 3, 3), 0.5f, 0.25f);
    const auto at = [&](float x, float y, float z = 1) { return map.intensity(normalize(Vec3{x, y, z})); };
    EXPECT_EQ(at(-0.4f, 0.2f), Rgb(1, 0, 0));
    EXPECT_EQ(at(0.4f, 0.2f), Rgb(0, 1, 0));
    EXPECT_EQ(at(-0.4f, -0.2f), Rgb(0, 0, 1));
    EXPECT_EQ(at(0.4f, -0.2f), Rgb(1.0f));
    for (const Rgb& outside : {at(0.51f, 0), at(-0.51f, 0), at(0, 0.26f), at(0, -0.26f), at(-0.4f, 0.2f, -1)})
        EXPECT_TRUE(outside.is_black());
    // The solid angle of a rectangle of half sides a and b at distance 1 is 4 atan(a b / sqrt(1 + a^2 + b^2)).
    const double whole = 4 * std::atan(0.5 * 0.25 / std::sqrt(1 + 0.25 + 0.0625));
    EXPECT_NEAR(map.integral().g, whole / 2, 1e-6);
}

/// pbrt-v4's goniometric lights have the pole of their octahedral map at +y. Its upper half is the middle of the square.
TEST(DirectionMap, WrapsAboutTheVertical) {
    Image image;
    image.width = image.height = 8;
    image.channels = 1;
    image.floats.assign(64, 0);
    for (const int i : {27, 28, 35, 36}) image.floats[size_t(i)] = 3;
    const DirectionMap map = DirectionMap::goniometric(image, Mat4());
    EXPECT_EQ(map.intensity({0, 1, 0}), Rgb(3.0f));
    for (const Vec3& dark : {Vec3{0, -1, 0}, Vec3{1, 0, 0}, Vec3{0, 0, 1}, Vec3{-1, 0, 0}, Vec3{0, 0, -1}})
        EXPECT_TRUE(map.intensity(dark).is_black());
    EXPECT_NEAR(map.integral().r, 3 * 4 * kPi * 4 / 64, 1e-5f);
    // x stays x: a texel right of the middle lights +x.
    image.floats.assign(64, 0);
    image.floats[3 * 8 + 5] = image.floats[4 * 8 + 5] = 1;
    const DirectionMap side = DirectionMap::goniometric(image, Mat4());
    EXPECT_FALSE(side.intensity(normalize(Vec3{0.6f, 0.8f, 0})).is_black());
    EXPECT_TRUE(side.intensity(normalize(Vec3{-0.6f, 0.8f, 0})).is_black());
}

/// A slide of one texel at 60 degrees and one of a hundredth of a degree: every texel keeps its share.
TEST(DirectionMap, SolidAnglesOfTexelsSumToTheWhole) {
    for (const double half : {0.577350269, 8.7e-5, 100.0}) {
        double sum = 0, least = 1;
        const std::vector<double> cells = projected_solid_angles(100, 50, half, half / 2);
        for (const double cell : cells) sum += cell, least = std::min(least, cell);
        EXPECT_NEAR(sum / (4 * std::atan(half * half / 2 / std::sqrt(1 + 1.25 * half * half))), 1, 1e-9) << half;
        EXPECT_GT(least, 0) << half;
        EXPECT_EQ(cells.size(), 5000u);
    }
}

}  // namespace
}  // namespace lightloom
