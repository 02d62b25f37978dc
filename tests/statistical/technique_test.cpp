// Techniques alone and in any combination: each technique's unweighted image of one path length has
// the same mean, and so has every subset of techniques whose weights are renormalised, light
// sub-paths that are cut short, every heuristic and every Russian roulette. All runs are production
// bdpt with a selection that switches techniques off.

#include <gtest/gtest.h>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::MaskedSelection;
using testing::RegionMeans;
using testing::TestFamily;

constexpr int kSeeds = 32;

RegionMeans masked(const std::shared_ptr<const Scene>& scene, const MaskedSelection& selection, int max_depth, uint32_t spp,
                   uint64_t first_seed) {
    const BdptAlgorithm<MaskedSelection> algorithm{selection};
    return testing::replicate(testing::algorithm_image(scene, algorithm, max_depth, spp), scene->frame().crop, kSeeds, first_seed);
}

/// One technique per run: its weight is then one, and the image is f / p of that technique.
TEST(Techniques, EachAloneHasTheSameMean) {
    TestFamily family;
    int pairs = 0, tested = 0;
    const struct {
        const char* name;
        std::shared_ptr<const Scene> (*make)();
    } scenes[] = {{"apart_with_lamp", testing::apart_with_lamp}, {"apart_with_sky", testing::apart_with_sky}};
    for (const auto& named : scenes) {
        const auto scene = named.make();
        for (int k = 2; k <= 4; ++k) {
            std::vector<RegionMeans> estimates;
            for (int s = 0; s <= k; ++s) {
                MaskedSelection only{testing::bdpt_selection(*scene)};
                only.only_s = s;
                only.min_k = only.max_k = k;
                // Hits of small lamps are rare: more samples make their means normal.
                estimates.push_back(masked(scene, only, k - 1, s == 0 ? 64 : 16, 10000 + 1000 * uint64_t(s)));
            }
            for (int s = 0; s <= k; ++s) {
                if (s == 1) continue;
                ++pairs;
                tested += testing::compare(
                    estimates[1], estimates[size_t(s)],
                    std::string(named.name) + ", k = " + std::to_string(k) + ", s = 1 and s = " + std::to_string(s), &family);
            }
        }
    }
    // Hits of a small lamp may stay too noisy for a test.
    EXPECT_GE(tested, pairs * 3 / 4);
    family.check();
}

/// Every subset of {s = 0, s = 1, connections, t = 1} that still samples every path: connections
/// alone make no path of two edges. (Directly visible light is s = 0 alone and left out.)
TEST(Techniques, AnySubsetThatSupportsEveryPathHasTheSameMean) {
    TestFamily family;
    int subsets = 0, tested = 0;
    const struct {
        const char* name;
        std::shared_ptr<const Scene> (*make)();
    } scenes[] = {{"diffuse_box", testing::diffuse_box}, {"environment_lit", testing::environment_lit}};
    for (const auto& named : scenes) {
        const auto scene = named.make();
        MaskedSelection all{testing::bdpt_selection(*scene)};
        all.min_k = 2;
        const RegionMeans reference = masked(scene, all, 4, 16, 20000);
        for (int mask = 1; mask < 15; ++mask) {
            MaskedSelection subset = all;
            subset.hits = mask & 1, subset.next_event = mask & 2, subset.connections = mask & 4, subset.light_tracing = mask & 8;
            if (!subset.hits && !subset.next_event && !subset.light_tracing) continue;
            ++subsets;
            tested += testing::compare(
                reference,
                masked(scene, subset, 4, subset.next_event || subset.light_tracing ? 16 : 64, 20000 + 1000 * uint64_t(mask)),
                std::string(named.name) + ", techniques " + std::to_string(mask), &family);
        }
    }
    EXPECT_GE(tested, subsets * 3 / 4) << "of " << subsets;
    family.check();
}

/// A cut light sub-path has no techniques beyond: they must leave the denominator, or the image
/// darkens.
TEST(Techniques, LightSubPathsMayBeCutShort) {
    TestFamily family;
    for (const auto make : {testing::diffuse_box, testing::glass_and_mirror}) {
        const auto scene = make();
        const MaskedSelection all{testing::bdpt_selection(*scene)};
        const RegionMeans reference = masked(scene, all, 7, 32, 40000);
        for (const int vertices : {2, 3, 5}) {
            MaskedSelection cut = all;
            cut.max_light_vertices = vertices;
            testing::compare(reference, masked(scene, cut, 7, 32, 40000 + 1000 * uint64_t(vertices)),
                             "light sub-paths of " + std::to_string(vertices) + " vertices", &family);
        }
    }
    family.check();
}

/// Production parameters: Russian roulette and the heuristic change the noise, never the mean.
TEST(Techniques, RouletteAndHeuristicsKeepTheMean) {
    TestFamily family;
    const auto scene = testing::glossy();
    const Rect& crop = scene->frame().crop;
    const std::map<std::string, std::string> variants[] = {{{"rr-min", "1"}},
                                                           {},
                                                           {{"rr-start", "2"}, {"rr-min", "0.05"}},
                                                           {{"rr-start", "2"}, {"rr-min", "0.3"}},
                                                           {{"rr-start", "2"}, {"rr-min", "0.6"}},
                                                           {{"heuristic", "1"}},
                                                           {{"heuristic", "2"}}};
    for (const std::string algorithm : {"path", "light", "bdpt"}) {
        std::vector<RegionMeans> estimates;
        std::vector<std::string> names;
        for (const auto& parameters : variants) {
            if (algorithm == "light" && parameters.contains("heuristic")) continue;
            std::string name = algorithm;
            for (const auto& [key, value] : parameters) name += " " + key + "=" + value;
            names.push_back(name);
            estimates.push_back(testing::replicate(testing::catalog_image(scene, algorithm, 8, 16, parameters), crop, kSeeds,
                                                   60000 + 1000 * uint64_t(estimates.size())));
        }
        for (size_t i = 1; i < estimates.size(); ++i)
            testing::compare(estimates[0], estimates[i], names[0] + " and " + names[i], &family);
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
