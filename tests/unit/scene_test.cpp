// Scenes at the ends of what single precision can hold.

#include <gtest/gtest.h>

#include "common/core/rng.h"
#include "common/scene/sampling.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

using testing::SceneBuilder;

Status build_status(SceneBuilder& builder) { return Scene::build(std::move(builder.description())).status(); }

/// A floor of size `s` with a sheet s/100 above one half of it.
std::shared_ptr<const Scene> floor_and_sheet(float s) {
    SceneBuilder b;
    const MaterialId grey = b.diffuse(Rgb(0.5f));
    b.quad({-s, 0, -s}, {0, 0, 2 * s}, {2 * s, 0, 0}, grey);
    b.quad({0, s / 100, -s}, {0, 0, 2 * s}, {s, 0, 0}, grey);
    b.look({0, s, -2 * s}, {0, 0, 0}, 40);
    return b.build();
}

TEST(SmallScenes, LeavingASurfaceNeitherHitsItNorSkipsItsNeighbour) {
    for (const float s : {100.0f, 1.0f, 0.1f, 1e-2f, 1e-4f, 1e-6f}) {
        const auto scene = floor_and_sheet(s);
        Rng rng({1, Stage::kCamera, 0, 0});
        int open = 0, blocked = 0;
        for (int i = 0; i < 4000; ++i) {
            const float x = 1.9f * (float(rng.uniform_double()) - 0.5f), z = 1.9f * (float(rng.uniform_double()) - 0.5f);
            SurfacePoint point;
            // From between floor and sheet, so that the floor is what is hit.
            ASSERT_TRUE(scene->intersect({x * s, s / 200, z * s}, {0, -1, 0}, &point));
            const Vec3 up = sample_cosine_hemisphere(rng.uniform2());
            const Vec3 direction{0.3f * up.x, up.z + 0.1f, 0.3f * up.y};
            const bool below_sheet = x > 0.1f;
            if (!below_sheet && x > -0.1f) continue;
            const bool occluded = scene->occluded(point.p, point.ng, point.reach, point.p + direction * (0.2f * s));
            SurfacePoint next;
            const bool found =
                scene->intersect(offset_origin(point.p, point.ng, direction, point.reach), normalize(direction), &next);
            EXPECT_EQ(occluded, found) << s;
            // The direction is steep enough to meet the sheet if it starts below it, and to miss it if not.
            EXPECT_EQ(occluded, below_sheet) << s << " " << x << " " << z;
            ++(below_sheet ? blocked : open);
        }
        EXPECT_GT(open, 1000);
        EXPECT_GT(blocked, 1000);
    }
}

TEST(SmallScenes, OffsetsOfOrdinaryScenesDoNotDependOnSmallPrimitives) {
    SceneBuilder b;
    const MaterialId grey = b.diffuse(Rgb(0.5f));
    b.quad({-10, -1, -10}, {0, 0, 20}, {20, 0, 0}, grey);
    b.quad({-1e-3f, 0, -1e-3f}, {0, 0, 2e-3f}, {2e-3f, 0, 0}, grey);
    const auto scene = b.build();
    SurfacePoint point;
    ASSERT_TRUE(scene->intersect({0, 1, 0}, {0, -1, 0}, &point));
    EXPECT_EQ(offset_origin(point.p, {0, 1, 0}, {0, 1, 0}, point.reach).y, 1.0f / 65536);
}

TEST(LargeScenes, ShapesWhoseAreaOverflowsAreNamed) {
    SceneBuilder b;
    const MaterialId grey = b.diffuse(Rgb(0.5f));
    b.quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, grey);
    b.quad({0, 0, 0}, {1e20f, 0, 0}, {0, 1e20f, 0}, grey).attributes.source = "scene.pbrt:7";
    const Status huge = build_status(b);
    EXPECT_EQ(huge.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(huge.message().find("scene.pbrt:7: triangle 0 is too large"), std::string::npos) << huge.message();

    for (const float radius : {1e20f, 1e-20f}) {
        SceneBuilder s;
        s.sphere({0, 0, 0}, radius, s.diffuse(Rgb(0.5f)));
        EXPECT_NE(build_status(s).message().find(radius > 1 ? "too large" : "too small"), std::string::npos);
    }

    // A triangle without area is dropped as before, also a large one.
    SceneBuilder flat;
    const MaterialId m = flat.diffuse(Rgb(0.5f));
    flat.quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, m);
    flat.quad({0, 0, 0}, {1e9f, 0, 0}, {2e9f, 0, 0}, m);
    const auto scene = flat.build();
    EXPECT_EQ(scene->summary().triangle_count, 2u);
}

TEST(Frame, ACropWindowTakesThePlaceOfTheFilms) {
    FilmDescription film;
    film.width = 200, film.height = 100;
    film.crop[0] = 50, film.crop[1] = 100, film.crop[2] = 20, film.crop[3] = 40;  // x0, x1, y0, y1
    EXPECT_EQ(frame_layout(film, {})->crop, (Rect{50, 20, 100, 40}));
    EXPECT_EQ(frame_layout(film, {.width = 100, .height = 50})->crop, (Rect{25, 10, 50, 20})) << "the film's is scaled along";
    const Rect window{1, 2, 3, 4};
    EXPECT_EQ(*frame_layout(film, {.crop = window}), (FrameLayout{200, 100, window}));
    EXPECT_EQ(*frame_layout(film, {.width = 100, .height = 50, .crop = window}), (FrameLayout{100, 50, window})) << "not so ours";
    for (const Rect& bad : {Rect{0, 0, 201, 1}, Rect{0, 0, 1, 101}, Rect{-1, 0, 1, 1}, Rect{0, -1, 1, 1}, Rect{5, 0, 5, 1}}) {
        const Status refused = frame_layout(film, {.crop = bad}).status();
        EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
        EXPECT_NE(refused.message().find("the frame has 200 x 100 pixels"), std::string::npos) << refused.message();
    }
    // A small window of a frame that is too large as a whole.
    film.crop[0] = -1;
    film.width = film.height = kMaxFrameSide;
    EXPECT_FALSE(frame_layout(film, {}).ok());
    EXPECT_TRUE(frame_layout(film, {.crop = window}).ok());
}

TEST(Summary, LightsSayWhereTheyAre) {
    SceneBuilder b;
    b.quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, b.diffuse(Rgb(0.5f)));
    SceneDescription& d = b.description();
    d.point_lights = {{{0, 0, 1}, Rgb(1.0f), "scene.pbrt:4"}, {{0, 0, 2}, Rgb(1.0f)}};
    d.spot_lights.push_back({{0, 0, 1}, {}, Rgb(1.0f), 0.3f, 0.1f, "scene.pbrt:5"});
    d.distant_lights.push_back({{0, 0, -1}, Rgb(1.0f), "scene.pbrt:6"});
    d.infinite_lights.push_back({.source = "scene.pbrt:7"});
    d.infinite_lights.push_back({.source = "scene.pbrt:8"});
    std::vector<std::string> where;
    const auto scene = b.build();
    for (const SceneSummary::Light& light : scene->summary().lights) where.push_back(light.where);
    EXPECT_EQ(where, (std::vector<std::string>{"scene.pbrt:4", "point light", "scene.pbrt:5", "scene.pbrt:6",
                                               "scene.pbrt:7 (and 1 more)"}));
}

}  // namespace
}  // namespace lightloom
