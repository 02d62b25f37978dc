// All algorithms of the catalog agree on every scene, for every path length and in every region. Each length has an image of its
// own.

#include <gtest/gtest.h>

#include <algorithm>
#include <string_view>

#include "common/transport/parameters.h"
#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;

constexpr int kSeeds = 32, kMaxLength = 6;
constexpr uint32_t kIterations = 16;

/// The emission that the algorithm has by default: spcbpt learns it, the others need no tables of every seed then. Their learned
/// emission is compared with emission by power in technique_test (random tables, and every choice of a parameter), with `path` in
/// learned_emission_test, and where they make all paths in table_fuzz_test.
std::map<std::string, std::string> with_default_emission(const std::string& algorithm) {
    const AlgorithmSettings row = testing::settings_of(algorithm).algorithm;
    if (!row.has(kEmission) || learns_emission(row)) return {};
    return {{std::string(kEmission), "power"}};
}

/// Scenes whose materials and lights others have, too: they are tested at night.
constexpr std::string_view kNightly[] = {"diffuse_box",      "textured_and_two_sided",  "textures_in_space",
                                         "bumped",           "smooth_normals_and_lens", "hidden_and_pictured_lamps",
                                         "rough_and_coated", "spheres_in_glass",        "fractional_opacity"};

/// One family over the scenes, pairs of algorithms, lengths and regions.
void expect_agreement(bool at_night) {
    testing::TestFamily family;
    int frames = 0, tested = 0;
    for (const testing::NamedScene& named : testing::kScenes) {
        if (std::ranges::count(kNightly, named.name) != at_night) continue;
        const auto scene = named.make();
        const std::vector<std::string> algorithms = testing::algorithms_of(named.complete);
        std::vector<std::vector<RegionMeans>> estimates;
        for (size_t a = 0; a < algorithms.size(); ++a) {
            // What is learned or cached is shared by all samples of a seed: more seeds instead of iterations.
            const auto parameters = with_default_emission(algorithms[a]);
            const int more = testing::settings_of(algorithms[a], parameters).algorithm.learning() ? 2 : 1;
            estimates.push_back(testing::lengths_of(scene, algorithms[a], kMaxLength, kIterations / uint32_t(more), more * kSeeds,
                                                    1000 * (a + 1), parameters));
        }
        for (size_t a = 0; a < algorithms.size(); ++a)
            for (size_t b = a + 1; b < algorithms.size(); ++b)
                for (size_t k = 1; k <= (named.caustics ? 2 : kMaxLength); ++k) {
                    const std::string what =
                        std::string(named.name) + ", " + algorithms[a] + " and " + algorithms[b] + ", k = " + std::to_string(k);
                    ++frames;
                    tested += testing::compare(estimates[a][k - 1], estimates[b][k - 1], what, &family);
                }
    }
    // Where camera or light sub-paths alone meet caustics or mirrors, long paths may stay too noisy for a test; few may.
    EXPECT_GE(tested, frames * 9 / 10);
    EXPECT_GT(family.size(), 1000);
    family.check();
}

TEST(Agreement, EveryLengthHasTheSameMeanInEveryAlgorithm) { expect_agreement(false); }
TEST(AgreementNightly, EveryLengthHasTheSameMeanInEveryAlgorithm) { expect_agreement(true); }

}  // namespace
}  // namespace lightloom
