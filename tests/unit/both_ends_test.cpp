// What a path meets is the same from both of its ends: a mixed material is decided by the point alone, whoever found it, and thin
// panes and surfaces of fractional opacity let as much through one way as the other. Weights rely on it and cannot see it, because
// they are rebuilt from the vertices that were found.

#include <gtest/gtest.h>

#include <cmath>

#include "common/path/camera_walk.h"
#include "common/path/light_walk.h"
#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// The material where `v` lies, looked up anew; nothing where it lies in the shadow of something else.
std::optional<Bsdf> looked_up(const Scene& scene, const PathVertex& v) {
    SurfacePoint point;
    if (!scene.intersect(v.p + v.wo * 1e-3f, -v.wo, &point) || length(point.p - v.p) > 1e-4f) return std::nullopt;
    point.p = v.p;  // to the last bit: a mix is decided by all of them
    return scene.bsdf_at(point);
}

/// Mutation: a light walk that looks materials up beside the surface (light_walk.h: point.p * 1.001f before bsdf_at()) fails this.
TEST(BothEnds, MixedMaterialsBelongToThePoint) {
    const auto scene = testing::mixes_and_pane();
    const RouletteRule rule;
    WalkCounters counters;
    std::vector<PathVertex> path(8);
    int compared = 0, others = 0;
    // Of the floor: what share of it is diffuse, as either kind of sub-path finds it.
    double floor[2] = {}, diffuse[2] = {};
    const auto compare = [&](int kind, int first, int n) {
        for (int i = first; i < n; ++i) {
            const PathVertex& v = path[size_t(i)];
            if (v.bsdf.kind == BsdfKind::kNull) continue;
            const auto bsdf = looked_up(*scene, v);
            if (!bsdf) continue;
            ++compared;
            others += bsdf->kind != v.bsdf.kind || bsdf->alpha_x != v.bsdf.alpha_x;
            if (v.p.y == 0) floor[kind] += 1, diffuse[kind] += v.bsdf.kind == BsdfKind::kDiffuse;
        }
    };
    for (uint64_t i = 0; i < 20000; ++i) {
        LightSampler light({5, Stage::kLight, 0, i});
        compare(0, 1, trace_light_path(*scene, light, 6, rule, path.data(), &counters));
        CameraSampler camera(5, i, i);
        const int t = trace_camera_path(
            *scene, camera, int(i % 32), int(i / 32 % 32), 5, rule, path.data(), &counters, [](int) {}, [](int, const WalkRay&) {});
        compare(1, 1, t);
    }
    EXPECT_GT(compared, 50000);
    EXPECT_EQ(others, 0);
    for (const int kind : {0, 1}) {
        EXPECT_GT(floor[kind], 2000);
        EXPECT_NEAR(diffuse[kind] / floor[kind], 0.7, 6 * std::sqrt(0.21 / floor[kind])) << (kind == 0 ? "light" : "camera");
    }
}

/// Methods that cross a surface from the camera, from the light, and from both agree, region by region.
/// Mutations: rays that go up see less opacity than those that go down (accel.cpp: opacity squared for dir_y > 0), or a pane that
/// transmits light sub-paths as a refracting interface does, fail this.
TEST(BothEnds, AlgorithmsAgreeWhereLightPassesThrough) {
    constexpr int kSeeds = 32;
    testing::TestFamily family;
    int tested = 0;
    for (const testing::NamedScene& named : testing::kScenes) {
        if (named.make != testing::mixes_and_pane && named.make != testing::fractional_opacity) continue;
        const auto scene = named.make();
        std::vector<std::pair<std::string, testing::RegionMeans>> all;
        for (const std::string& name : testing::algorithms_of(named.complete))
            if (!testing::settings_of(name).algorithm.learning() && !(*find_algorithm(name))->merges)
                all.emplace_back(name, testing::replicate(testing::catalog_image(scene, name, 3, 4,
                                                                                 testing::those_of(name, {{"emission", "power"}})),
                                                          scene->frame().crop, kSeeds, 1000 * (all.size() + 1)));
        for (size_t a = 0; a < all.size(); ++a)
            for (size_t b = a + 1; b < all.size(); ++b)
                tested += testing::compare(all[a].second, all[b].second,
                                           std::string(named.name) + ", " + all[a].first + " and " + all[b].first, &family);
    }
    EXPECT_EQ(tested, 4);
    family.check();
}

}  // namespace
}  // namespace lightloom
