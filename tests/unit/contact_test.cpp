// Surfaces at distance zero of a camera, a lamp or an area light: what is visible does not depend on the end that asks.

#include <gtest/gtest.h>

#include <cmath>

#include "common/path/camera_walk.h"
#include "common/path/light_walk.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

/// Scenes are tilted, so that coordinates are rounded, and scaled.
struct Placing {
    float size = 1;
    Mat4 tilt = rotation(31, 1, 2, 3);

    Vec3 operator()(const Vec3& p) const { return tilt.point(p * size); }
};

constexpr float kSizes[] = {1e-3f, 1, 1e4f};

/// A closed box of half edge 1 about the origin.
testing::SceneBuilder box(const Placing& at, const Vec3& eye, const Vec3& to) {
    testing::SceneBuilder b;
    b.room({-1, -1, -1}, {1, 1, 1}, b.diffuse(Rgb(0.5f)));
    for (TriangleMesh& mesh : b.description().meshes)
        for (Vec3& p : mesh.positions) p = at(p);
    b.look(at(eye), at(to), 70);
    return b;
}

/// A quad in the plane y = `height`, facing down.
void add_light(testing::SceneBuilder* b, const Placing& at, float height) {
    const Vec3 corner = at({-0.4f, height, -0.3f});
    b->quad(corner, at({0.2f, height, -0.3f}) - corner, at({-0.4f, height, 0.4f}) - corner, b->diffuse(Rgb(0.5f)),
            b->emission(Rgb(1.0f)));
}

/// Mutation: Scene::find_contacts() that leaves lamps out hides the lamp from half of its own rays.
TEST(Contact, ALampOnASurfaceIsSeenFromWhereItSends) {
    for (const float size : kSizes) {
        const Placing at{.size = size};
        auto b = box(at, {0, 0, -0.9f}, {0, -0.3f, 1});
        const Vec3 lamp = at({0.1f, 1, 0.2f});
        b.description().point_lights.push_back({lamp, Rgb(1.0f)});
        const auto scene = b.build();
        const float clearance = scene->emitters()[0].clearance;
        EXPECT_GT(clearance, 0);
        EXPECT_LT(clearance, 1e-3f * size);
        Rng rng({1, Stage::kConnect, 0, 0});
        int inside = 0, seen = 0;
        for (int i = 0; i < 2000; ++i) {
            const Vec3 d = sample_sphere(rng.uniform2());
            SurfacePoint point;
            if (!scene->intersect(lamp, d, &point, clearance)) continue;
            ++inside;
            seen += !scene->occluded(point.p, point.ng, point.reach, lamp, clearance);
        }
        EXPECT_GT(inside, 900) << size;  // the lower half: the upper one leaves the box
        EXPECT_GE(seen, inside - 2) << size;
    }
}

TEST(Contact, ALampAwayFromSurfacesHasNoClearance) {
    const Placing at;
    auto b = box(at, {0, 0, -0.9f}, {0, -0.3f, 1});
    b.description().point_lights.push_back({at({0.1f, 0.9999f, 0.2f}), Rgb(1.0f)});
    const auto scene = b.build();
    EXPECT_EQ(scene->emitters()[0].clearance, 0);
    EXPECT_EQ(scene->camera_clearance(), 0);
}

TEST(Contact, ACameraOnASurfaceSeesPastIt) {
    for (const float size : kSizes) {
        const Placing at{.size = size};
        auto b = box(at, {0.2f, -1, 0.1f}, {0, 1, 0});
        add_light(&b, at, 0.5f);
        const auto scene = b.build();
        EXPECT_GT(scene->camera_clearance(), 0) << size;
        WalkCounters counters;
        std::vector<PathVertex> path(4);
        int stuck = 0;
        for (uint64_t i = 0; i < 1000; ++i) {
            CameraSampler sampler(3, i, i);
            int t = 0;
            trace_camera_path(
                *scene, sampler, int(i % 32), int(i / 32 % 32), 1, RouletteRule{}, path.data(), &counters, [&](int n) { t = n; },
                [](int, const WalkRay&) {});
            stuck += t < 2 || length(path[1].p - path[0].p) < 0.1f * size;
        }
        EXPECT_EQ(stuck, 0) << size;
    }
}

/// Rays of an orthographic camera start in a window, which may lie in the plane of a wall that its centre does not touch.
TEST(Contact, AWindowInAWallsPlaneSeesPastIt) {
    for (const float size : kSizes) {
        Placing at{.size = size, .tilt = rotation(25, 0, 1, 0)};
        auto b = box(at, {0, -0.9f, -1}, {0, -0.9f, 1});
        // The wall behind the camera has a hole where the window's centre is.
        TriangleMesh& wall = b.description().meshes[4];
        for (Vec3& p : wall.positions) p = p + at({0, 0.5f, 0});
        b.description().camera.kind = CameraKind::kOrthographic;
        b.description().camera.has_screen_window = true;
        for (float& edge : b.description().camera.screen_window) edge *= size;
        const auto scene = b.build();
        const float clearance = scene->camera_clearance();
        EXPECT_GT(clearance, 0) << size;
        EXPECT_LT(clearance, 1e-3f * size) << size;
        int stuck = 0;
        for (int i = 0; i < 1000; ++i) {
            const auto ray = scene->camera().sample_ray({float(i % 32) + 0.3f, float(i / 32 % 32) + 0.6f}, {});
            SurfacePoint point;
            stuck += scene->intersect(ray.origin, ray.direction, &point, clearance) && length(point.p - ray.origin) < 0.1f * size;
        }
        EXPECT_EQ(stuck, 0) << size;
    }
}

/// A panel over a forest: what is merely near it must not be looked through triangle by triangle, which took seconds here.
TEST(Contact, APanelAboveManyTrianglesFindsWhatItTouches) {
    testing::SceneBuilder b;
    const MaterialId grey = b.diffuse(Rgb(0.5f));
    SceneDescription& d = b.description();
    ObjectDefinition tree;
    TriangleMesh leaves;
    Rng rng({5, Stage::kConnect, 0, 0});
    for (uint32_t i = 0; i < 3000; ++i) {
        const Vec2 a = rng.uniform2(), c = rng.uniform2();
        const Vec3 p{a.x, 4 * a.y, c.x};
        leaves.positions.insert(leaves.positions.end(), {p, p + Vec3{0.02f, 0, 0.01f}, p + Vec3{0, 0.02f, 0.02f}});
        leaves.indices.insert(leaves.indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
    }
    leaves.attributes.material = grey;
    tree.meshes.push_back(std::move(leaves));
    d.objects.push_back(std::move(tree));
    for (int i = 0; i < 2500; ++i) d.instances.push_back({0, translation(4 * (i % 50) - 100, 0, 4 * (i / 50) - 100), "tree"});
    b.quad({-100, 12, -100}, {200, 0, 0}, {0, 0, 200}, grey, b.emission(Rgb(1.0f)));
    const auto apart = b.description();
    const auto count = [](const SceneDescription& description) {
        const auto scene = Scene::build(description);
        EXPECT_TRUE(scene.ok());
        SurfacePoint point;
        // From below, within the part that the ceiling shares.
        return (*scene)->intersect({3, 8, 3}, {0, 1, 0}, &point) && point.emitter != kNone;
    };
    EXPECT_TRUE(count(apart));
    // A ceiling in the panel's plane, small beside it.
    b.quad({2, 12, 2}, {3, 0, 0}, {0, 0, 3}, grey);
    EXPECT_TRUE(count(b.description()));
}

/// Mutation: an Accel::intersect() alone, without the one among lights, reports the ceiling in a share of these.
TEST(Contact, ALightInAnotherSurfacesPlaneIsWhatIsThere) {
    for (const float size : kSizes)
        for (const bool instanced : {false, true}) {
            const Placing at{.size = size};
            auto b = box(at, {0, 0, -0.9f}, {0, -0.3f, 1});
            if (instanced) {  // the box as an object, put into the scene as it is
                ObjectDefinition object;
                object.meshes = std::move(b.description().meshes);
                b.description().meshes.clear();
                b.description().objects.push_back(std::move(object));
                b.description().instances.push_back({0, Mat4{}, "here:1"});
            }
            add_light(&b, at, 1);
            const auto scene = b.build();
            Rng rng({2, Stage::kConnect, 0, 0});
            int light = 0, hidden = 0;
            constexpr int kRays = 2000;
            for (int i = 0; i < kRays; ++i) {
                const Vec2 u = rng.uniform2(), v = rng.uniform2();
                const Vec3 from = at({1.8f * v.x - 0.9f, 0.8f - 1.6f * rng.uniform(), 1.8f * v.y - 0.9f});
                const Vec3 to = at({-0.39f + 0.58f * u.x, 1, -0.29f + 0.68f * u.y});
                SurfacePoint point;
                ASSERT_TRUE(scene->intersect(from, normalize(to - from), &point));
                light += point.emitter != kNone;
                const Emitter& e = scene->emitters()[0];
                SurfacePoint wall;
                if (scene->intersect(to + e.normal * (0.01f * size), normalize(from - to), &wall))
                    hidden += scene->occluded(wall.p, wall.ng, wall.reach, to, e.normal, e.reach);
            }
            EXPECT_EQ(light, kRays) << size << instanced;
            EXPECT_LE(hidden, 2) << size << instanced;  // rays along an edge of the box
        }
}

/// A neighbour of a light in the same plane, and a light that is alone, are no business of this.
TEST(Contact, NeighboursAndLightsOfTheirOwnAreLeftAlone) {
    const Placing at;
    auto b = box(at, {0, 0, -0.9f}, {0, -0.3f, 1});
    add_light(&b, at, 0.9f);
    const auto scene = b.build();
    SurfacePoint point;
    const Vec3 beside = at({0.8f, 1, 0.8f}), eye = at({0, 0, 0});
    ASSERT_TRUE(scene->intersect(eye, normalize(beside - eye), &point));
    EXPECT_EQ(point.emitter, kNone);
}

/// Lossless glass keeps a camera sub-path alive although entering divides its radiance by eta^2; nothing is divided by a survival.
/// Mutation: WalkRay::index_ratio2 := 1 in survive().
TEST(Roulette, LosslessGlassEndsNoSubPath) {
    testing::SceneBuilder b;
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    b.room({1, 1, 1}, {-1, -1, -1}, b.add(glass));  // facing out
    b.look({2, 3, -5}, {0, 0, 0}, 25);
    InfiniteLight sky;
    b.description().infinite_lights = {sky};
    const auto scene = b.build();
    WalkCounters counters;
    std::vector<PathVertex> path(130);
    const RouletteRule rule;
    int escaped = 0, long_ones = 0;
    constexpr int kPaths = 3000;
    for (uint64_t i = 0; i < kPaths; ++i) {
        CameraSampler sampler(4, i, i);
        const int t = trace_camera_path(
            *scene, sampler, int(i % 32), int(i / 32 % 32), 120, rule, path.data(), &counters, [](int) {},
            [&](int, const WalkRay& ray) {
                ++escaped;
                EXPECT_EQ(ray.survival, 1);
            });
        long_ones += t > rule.first_vertex + 2;
    }
    EXPECT_EQ(escaped, kPaths);
    EXPECT_GT(long_ones, kPaths / 50);
}

}  // namespace
}  // namespace lightloom
