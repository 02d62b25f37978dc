// Lights whose strength an image gives: which way round it is, and that nothing of it is left out. Their densities and power are
// tested with those of all others (emitter_test).

#include "common/scene/light_map.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace lightloom
