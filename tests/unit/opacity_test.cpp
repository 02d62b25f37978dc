// Cut-out opacity: a ray meets every surface anew, so that layers let through the product of what each lets through, and every
// layer can be hit behind every other. (pbrt draws one number per ray for all surfaces on its way: there a second layer costs
// nothing, and can be hit from one side only, which no bidirectional method can weigh.)

#include <gtest/gtest.h>

#include <cmath>

#include "common/core/rng.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

constexpr int kRays = 40000;
constexpr float kOpacity = 0.53f;

/// Layers of one kind at z = 1, 2, ...; rays run along +z.
std::shared_ptr<const Scene> layers(int count, bool in_one_mesh) {
    testing::SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.5f));
    const TextureId half = b.constant(Rgb(kOpacity));
    for (int i = 0; i < count; ++i) b.quad({-2, -2, float(i + 1)}, {4, 0, 0}, {0, 4, 0}, white);
    auto& meshes = b.description().meshes;
    while (in_one_mesh && meshes.size() > 1) {
        TriangleMesh& all = meshes.front();
        const uint32_t first = uint32_t(all.positions.size());
        for (const Vec3& p : meshes.back().positions) all.positions.push_back(p);
        for (const uint32_t i : meshes.back().indices) all.indices.push_back(first + i);
        meshes.pop_back();
    }
    for (TriangleMesh& mesh : meshes) mesh.attributes.alpha = half;
    return b.build();
}

Vec3 origin(Rng* rng, float z) { return {2 * rng->uniform() - 1, 2 * rng->uniform() - 1, z}; }

/// Number of standard deviations between a count and its expectation.
double deviation(int count, double probability) {
    return (count - kRays * probability) / std::sqrt(kRays * probability * (1 - probability));
}

TEST(Opacity, LayersAreIndependent) {
    constexpr int kLayers = 3;
    for (const bool in_one_mesh : {false, true}) {
        const auto scene = layers(kLayers, in_one_mesh);
        for (const float direction : {1.0f, -1.0f}) {
            int hits[kLayers + 1] = {}, clear = 0;
            Rng rng({11});
            for (int n = 0; n < kRays; ++n) {
                const Vec3 o = origin(&rng, direction > 0 ? 0.0f : kLayers + 1.0f);
                SurfacePoint point;
                const bool hit = scene->intersect(o, {0, 0, direction}, &point);
                const float from_start = std::fabs(point.p.z - o.z);
                ++hits[hit ? int(std::lround(from_start)) - 1 : kLayers];
                clear += !scene->occluded(origin(&rng, -1), {0, 0, 1}, 0, origin(&rng, kLayers + 2.0f));
            }
            for (int i = 0; i <= kLayers; ++i) {
                const double passed = std::pow(1 - kOpacity, i);
                EXPECT_LT(std::fabs(deviation(hits[i], i < kLayers ? passed * kOpacity : passed)), 4.5)
                    << "layer " << i << (in_one_mesh ? " of one mesh" : "");
            }
            EXPECT_LT(std::fabs(deviation(clear, std::pow(1 - kOpacity, kLayers))), 4.5);
        }
    }
}

TEST(Opacity, BothSidesOfASphereCount) {
    testing::SceneBuilder b;
    b.sphere({0, 0, 2}, 1, b.diffuse(Rgb(0.5f))).attributes.alpha = b.constant(Rgb(kOpacity));
    const auto scene = b.build();
    int clear = 0;
    Rng rng({12});
    for (int n = 0; n < kRays; ++n) {
        SurfacePoint point;
        const Vec3 o{0.5f * rng.uniform(), 0.5f * rng.uniform(), 0};
        clear += !scene->intersect(o, {0, 0, 1}, &point);
    }
    EXPECT_LT(std::fabs(deviation(clear, (1 - kOpacity) * (1 - kOpacity))), 4.5);
}

}  // namespace
}  // namespace lightloom
