// All algorithms of the catalog agree on every scene, for every path length and in every region. An
// image of max_depth d has all paths of up to d + 1 edges, and the same seed makes the same shorter
// ones, so the difference of two depths is the image of one length.

#include <gtest/gtest.h>

#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;

constexpr int kSeeds = 32, kMaxLength = 6;
constexpr uint32_t kSamplesPerPixel = 16;

/// Estimates of the lengths 1 .. kMaxLength, from independent seeds.
std::vector<RegionMeans> lengths_of(const std::shared_ptr<const Scene>& scene, const std::string& algorithm, uint64_t first_seed) {
    if ((*find_algorithm(algorithm))->needs_tables)
        return testing::lengths_with_tables(scene, algorithm, kMaxLength, kSamplesPerPixel / 2, 2 * kSeeds, first_seed);
    std::vector<RegionMeans> lengths(kMaxLength);
    const Rect& crop = scene->frame().crop;
    for (int i = 0; i < kSeeds; ++i) {
        std::vector<double> shorter(size_t(crop.area()), 0);
        for (int k = 1; k <= kMaxLength; ++k) {
            const std::vector<double> all =
                testing::catalog_image(scene, algorithm, k - 1, kSamplesPerPixel)(first_seed + uint64_t(i));
            std::vector<double> length(all.size());
            for (size_t p = 0; p < all.size(); ++p) length[p] = all[p] - shorter[p];
            lengths[size_t(k - 1)].add(length, crop);
            shorter = all;
        }
    }
    return lengths;
}

/// One family over all scenes, pairs of algorithms, lengths and regions.
TEST(Agreement, EveryLengthHasTheSameMeanInEveryAlgorithm) {
    testing::TestFamily family;
    int frames = 0, tested = 0;
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        const std::vector<std::string> algorithms = testing::algorithms_of(named.complete);
        std::vector<std::vector<RegionMeans>> estimates;
        for (size_t a = 0; a < algorithms.size(); ++a) estimates.push_back(lengths_of(scene, algorithms[a], 1000 * (a + 1)));
        for (size_t a = 0; a < algorithms.size(); ++a)
            for (size_t b = a + 1; b < algorithms.size(); ++b)
                for (size_t k = 1; k <= (named.caustics ? 2 : kMaxLength); ++k) {
                    const std::string what =
                        std::string(named.name) + ", " + algorithms[a] + " and " + algorithms[b] + ", k = " + std::to_string(k);
                    ++frames;
                    tested += testing::compare(estimates[a][k - 1], estimates[b][k - 1], what, &family);
                }
    }
    // Where `path` and `light` meet caustics or mirrors, long paths may stay too noisy for a test;
    // few may.
    EXPECT_GE(tested, frames * 9 / 10);
    EXPECT_GT(family.size(), 1000);
    family.check();
}

}  // namespace
}  // namespace lightloom
