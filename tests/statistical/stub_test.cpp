// The methods to come, as stubs of production pieces: pairing over the whole frame, next event estimation beside a cache, and
// algorithms of all shapes have bdpt's mean, merging has it up to the bias of its kernel.

#include <gtest/gtest.h>

#include "common/transport/lvcbpt.h"
#include "tests/support/stub_algorithms.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::LightPool;
using testing::RegionMeans;

constexpr int kSeeds = 32, kMaxDepth = 4;

/// Replications of a pool algorithm; each seed traces a pool of its own.
template <class Selection>
RegionMeans replicate_pool(const std::shared_ptr<const Scene>& scene, testing::PoolAlgorithm<Selection> algorithm, int light_paths,
                           uint32_t samples_per_pixel, uint64_t first_seed) {
    const auto image = [&](uint64_t seed) {
        const LightPool pool = testing::trace_light_pool(*scene, seed, light_paths, kMaxDepth + 1);
        algorithm.pool = &pool;
        return testing::algorithm_image(scene, algorithm, kMaxDepth, samples_per_pixel)(seed);
    };
    return testing::replicate(image, scene->frame().crop, kSeeds, first_seed);
}

RegionMeans reference(const std::shared_ptr<const Scene>& scene) {
    return testing::replicate(testing::catalog_image(scene, "bdpt", kMaxDepth, 16), scene->frame().crop, kSeeds, 100);
}

TEST(Stubs, PairingOverTheFrameHasTheSameMean) {
    testing::TestFamily family;
    for (const auto make : {testing::diffuse_box, testing::glass_and_mirror, testing::environment_lit}) {
        const auto scene = make();
        const RegionMeans bdpt = reference(scene);
        for (const int pairs : {1, 4}) {
            testing::PairingStubSelection selection{testing::bdpt_selection(*scene), double(pairs)};
            const testing::PoolAlgorithm<testing::PairingStubSelection> algorithm{selection, nullptr, pairs};
            EXPECT_TRUE(testing::compare(bdpt, replicate_pool(scene, algorithm, 1024, 8, 1000 + 100 * uint64_t(pairs)),
                                         std::to_string(pairs) + " pairs", &family));
        }
    }
    family.check();
}

/// Points on lights are connected from the cache and chosen afresh: two techniques of one split. A sphere is chosen by its cone in
/// one of them and by its area in the other.
TEST(Stubs, NextEventBesideTheCacheHasTheSameMean) {
    testing::TestFamily family;
    const TypicalSurvival survival{RouletteRule{}};
    for (const auto make : {testing::diffuse_box, testing::spherical_lights, testing::environment_lit, testing::delta_lights}) {
        const auto scene = make();
        const RegionMeans bdpt = reference(scene);
        for (const int rays : {0, 1, 4}) {
            const UniformSelection selection{double(scene->frame().crop.area()), 3 / 2.5, survival, {rays, rays > 0}};
            const LvcbptAlgorithm<> algorithm{{selection, 3}, Heuristic::kBalance, 1000};
            EXPECT_TRUE(testing::compare(
                bdpt,
                testing::replicate(testing::algorithm_image(scene, algorithm, kMaxDepth, 8), scene->frame().crop, kSeeds, 3000),
                std::to_string(rays) + " rays beside the cache", &family));
        }
    }
    family.check();
}

/// The rows of shape_rows.cpp: loops of its own, splats alone, a state for every iteration.
TEST(Stubs, AlgorithmsOfAllShapesHaveTheSameMean) {
    testing::TestFamily family;
    int rows = 0;
    for (const auto make : {testing::diffuse_box, testing::glass_and_mirror, testing::environment_lit}) {
        const auto scene = make();
        const RegionMeans bdpt = reference(scene);
        for (const AlgorithmInfo* row : catalog()) {
            if (!row->name.starts_with("stub-")) continue;
            ++rows;
            testing::compare(bdpt,
                             testing::replicate(testing::catalog_image(scene, std::string(row->name), kMaxDepth, 16),
                                                scene->frame().crop, kSeeds, 4000),
                             std::string(row->name), &family);
        }
    }
    EXPECT_EQ(rows, 9);
    EXPECT_GE(family.size(), 50);
    family.check();
}

/// A disc of radius r that reaches over an edge of a surface loses the part beyond: 2 / (3 pi) of
/// it on average over a strip of width r, so with edges of total length L on an area A the image
/// loses at most 2 r L / (3 pi A) of what is merged.
TEST(Stubs, MergingHasTheMeanUpToItsKernel) {
    const auto scene = testing::diffuse_box();
    const double radius = 0.03, edges = 6 * 8 + 4 * 0.6 + 2 * 4 * 0.5, area = 6 * 4 + 0.36 + 2 * 0.25 + 4 * kPiD * 0.16;
    const double kernel_bias = 2 * radius * edges / (3 * kPiD * area);
    const int light_paths = 2048;
    const testing::MergeStubSelection selection{testing::bdpt_selection(*scene), double(light_paths), radius};
    testing::PoolAlgorithm<testing::MergeStubSelection> algorithm{selection, nullptr, 1, float(radius)};
    const testing::Sample bdpt = reference(scene).frame(), merging = replicate_pool(scene, algorithm, light_paths, 2, 2000).frame();
    algorithm.add_merges = false;
    const testing::Sample without = replicate_pool(scene, algorithm, light_paths, 2, 2000).frame();

    // Merges carry a good part of the light, so the comparison is about them.
    const double share = 1 - without.mean / bdpt.mean;
    EXPECT_GT(share, 0.1);
    const double error = std::sqrt(bdpt.variance + merging.variance) / bdpt.mean;
    EXPECT_LT(error, 0.01);
    EXPECT_LT(merging.mean / bdpt.mean - 1, 4 * error);
    EXPECT_GT(merging.mean / bdpt.mean - 1, -kernel_bias - 4 * error) << "share of merges " << share;
}

}  // namespace
}  // namespace lightloom
