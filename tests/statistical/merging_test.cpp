// Merging is biased, by as much as its radius explains and no more: halving the radius halves what edges take, and with small discs
// the means are those of bdpt and, for light that only merging and hits find, those of path.

#include <gtest/gtest.h>

#include <tuple>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

constexpr int kSeeds = 32, kMaxDepth = 4;

testing::Sample frame_mean(const std::shared_ptr<const Scene>& scene, const std::string& algorithm,
                           const std::map<std::string, std::string>& parameters, const TechniqueMask& mask, uint64_t first_seed) {
    return testing::replicate(testing::catalog_image(scene, algorithm, kMaxDepth, 16, parameters, mask), scene->frame().crop,
                              kSeeds, first_seed)
        .frame();
}

TechniqueMask merges_alone() {
    TechniqueMask mask{.min_k = 2};
    for (int kind = 0; kind < kTechniqueKinds; ++kind) mask.on[kind] = kind == int(TechniqueKind::kMerge);
    return mask;
}

/// A disc of radius r that reaches over an edge of a surface loses the part beyond. Only that is lost in a box of flat diffuse
/// walls, and it falls as r. All light is merged here, once, so that the whole of it shows.
/// Mutations: the kernel's or the weight's area off by a factor, photons counted by vertices, fail this.
TEST(Merging, BiasFallsAsTheRadius) {
    const auto scene = testing::diffuse_box();
    const testing::Sample expected = frame_mean(scene, "bdpt", {}, {.min_k = 2}, 100);
    for (const char* kernel : {"constant", "epanechnikov"}) {
        double last = 0;
        for (const auto& [radius, seed] : {std::pair{"80", 1000}, {"40", 2000}, {"20", 3000}}) {
            const testing::Sample merged = frame_mean(scene, "vcm",
                                                      {{"merge-first", "on"},
                                                       {"merge-radius", radius},
                                                       {"merge-radius-unit", "scene"},
                                                       {"alpha", "1"},
                                                       {"light-paths", "4"},
                                                       {"kernel", kernel}},
                                                      merges_alone(), uint64_t(seed));
            const double bias = 1 - merged.mean / expected.mean;
            const double error = std::sqrt(merged.variance + expected.variance) / expected.mean;
            EXPECT_LT(error, 0.004);
            EXPECT_GT(bias, 0) << kernel << ", radius " << radius;
            if (last > 0) {
                EXPECT_NEAR(bias / last, 0.5, 0.1 + 4 * error / last) << kernel << ", radius " << radius;
            }
            last = bias;
        }
        EXPECT_LT(last, 0.05) << kernel;
    }
}

/// Techniques left out leave the rest with the same mean, merging among them or not.
TEST(Merging, AnySubsetHasTheSameMeanUpToTheKernel) {
    const auto scene = testing::diffuse_box();
    const testing::Sample expected = frame_mean(scene, "bdpt", {}, {.min_k = 2}, 100);
    uint64_t seed = 10000;
    for (int bits = 0; bits < 16; ++bits) {
        TechniqueMask mask{.min_k = 2};
        for (int kind = 0; kind < 4; ++kind) mask.on[kind] = bits >> kind & 1;
        const testing::Sample found = frame_mean(
            scene, "vcm", {{"merge-first", "on"}, {"merge-radius", "20"}, {"merge-radius-unit", "scene"}, {"alpha", "1"}}, mask,
            seed += 100);
        const double error = std::sqrt(found.variance + expected.variance) / expected.mean;
        EXPECT_LT(error, 0.01) << bits;
        EXPECT_LT(found.mean / expected.mean - 1, 4 * error) << bits;
        EXPECT_GT(found.mean / expected.mean - 1, -0.05 - 4 * error) << bits;
    }
}

/// spcbpt has the same mean whether it merges or not, but for what edges take from discs. It falls with their radius: of two pixels
/// some per cent of so small a frame, of a fifth of one nothing that can be seen.
TEST(Merging, InSpcbptHasTheSameMeanUpToTheKernel) {
    struct Place {
        const char* name;
        std::shared_ptr<const Scene> (*make)();
    };
    for (const auto& [name, make] : {Place{"diffuse box", testing::diffuse_box}, Place{"glossy", testing::glossy}}) {
        const auto scene = make();
        const testing::Sample expected = frame_mean(scene, "spcbpt", {}, {.min_k = 2}, 100);
        for (const auto& [radius, least, seed] : {std::tuple{"2", -0.05, 20000}, {"0.2", -0.005, 21000}}) {
            const testing::Sample found =
                frame_mean(scene, "spcbpt", {{"merging", "on"}, {"merge-radius", radius}}, {.min_k = 2}, uint64_t(seed));
            const double error = std::sqrt(found.variance + expected.variance) / expected.mean;
            EXPECT_LT(error, 0.01) << name;
            EXPECT_GT(found.mean / expected.mean - 1, least - 4 * error) << name << ", radius " << radius;
            EXPECT_LT(found.mean / expected.mean - 1, 0.005 + 4 * error) << name << ", radius " << radius;
        }
    }
}

}  // namespace
}  // namespace lightloom
