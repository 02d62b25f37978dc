// Techniques alone and in any combination, for every row of the catalog: each technique's unweighted image of one path length has
// the same mean, and so has every subset of techniques whose weights are renormalised, light sub-paths that are cut short, every
// heuristic, correction and Russian roulette. All runs are production renderers with a mask; tables know nothing.

#include <gtest/gtest.h>

#include "tests/support/row_techniques.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;
using testing::RowTechniques;
using testing::TestFamily;

constexpr int kSeeds = 32;
/// What the others are compared with: it samples every path of these scenes.
const char* const kReference = "bdpt";

struct Place {
    const char* name;
    std::shared_ptr<const Scene> (*make)();
};

RegionMeans means(const std::shared_ptr<const Scene>& scene, const testing::ImageOfSeed& image, uint64_t first_seed) {
    return testing::replicate(image, scene->frame().crop, kSeeds, first_seed);
}

RegionMeans reference(const std::shared_ptr<const Scene>& scene, int max_depth, uint32_t iterations, const TechniqueMask& mask,
                      uint64_t first_seed) {
    return means(scene, testing::catalog_image(scene, kReference, max_depth, iterations, {}, mask), first_seed);
}

/// A row with a mask, and with random tables if it has any. Wide tables are as unbiased, but noisier than a test can use.
RegionMeans masked(const std::shared_ptr<const Scene>& scene, const AlgorithmInfo& row, const TechniqueMask& mask, int max_depth,
                   uint32_t iterations, uint64_t first_seed) {
    testing::RandomTableOptions random;
    random.light_count = 8, random.eye_count = 6, random.spread = 2, random.max_window = 2;
    const Tables tables = testing::random_tables_for(row, *scene, 600 + first_seed, random);
    testing::CacheOptions options;
    options.paths = 4000;
    const RenderSettings settings = testing::cache_settings(std::string(row.name), options, max_depth);
    return means(scene, testing::table_image(scene, settings, tables, iterations, mask), first_seed);
}

/// One technique per run: its weight is then one, and the image is f / p of that technique.
TEST(Techniques, EachAloneHasTheSameMean) {
    TestFamily family;
    int pairs = 0, tested = 0;
    for (const Place& place : {Place{"apart_with_lamp", testing::apart_with_lamp}, {"apart_with_sky", testing::apart_with_sky}}) {
        const auto scene = place.make();
        for (int k = 2; k <= 4; ++k) {
            const RegionMeans expected = reference(scene, k - 1, 16, TechniqueMask::length(k), 10000);
            uint64_t seed = 11000;
            for (const AlgorithmInfo* row : catalog()) {
                for (const Technique t : testing::techniques_of(*row, scene).of_length(k)) {
                    // Hits of small lamps are rare: more samples make their means normal.
                    const uint32_t iterations = t.kind == TechniqueKind::kHit ? 64 : 16;
                    ++pairs;
                    tested +=
                        testing::compare(expected, masked(scene, *row, testing::mask_of(t, k), k - 1, iterations, seed += 100),
                                         std::string(place.name) + ", k = " + std::to_string(k) + ", " + std::string(row->name) +
                                             " by " + std::string(to_string(t.kind)) + " " + std::to_string(t.s),
                                         &family);
                }
            }
        }
    }
    // Hits of a small lamp may stay too noisy for a test.
    EXPECT_GE(tested, pairs * 3 / 4) << "of " << pairs;
    family.check();
}

/// Every subset of {hit, next event, connect, lens} that still samples every path. (Directly visible light is a hit alone and left
/// out.)
void expect_subsets_to_agree(const Place& place) {
    TestFamily family;
    int subsets = 0, tested = 0;
    const auto scene = place.make();
    const RegionMeans expected = reference(scene, 4, 16, {.min_k = 2}, 20000);
    uint64_t seed = 21000;
    for (const AlgorithmInfo* row : catalog()) {
        const RowTechniques has = testing::techniques_of(*row, scene);
        for (int bits = 1; bits < has.bits(); ++bits) {
            if ((bits & has.bits()) != bits || !has.suffices(bits)) continue;
            TechniqueMask mask = testing::mask_of_bits(bits);
            mask.min_k = 2;
            // Paths of two edges by hits alone are rare.
            const bool rare = !(bits & 0b1010) && !(bits & 0b100 && has.connect_to_light);
            ++subsets;
            tested += testing::compare(
                expected, masked(scene, *row, mask, 4, rare ? 64 : 16, seed += 100),
                std::string(place.name) + ", " + std::string(row->name) + ", techniques " + std::to_string(bits), &family);
        }
    }
    EXPECT_GE(tested, subsets * 3 / 4) << "of " << subsets;
    family.check();
}

TEST(Techniques, AnySubsetThatSupportsEveryPathHasTheSameMean) {
    expect_subsets_to_agree({"environment_lit", testing::environment_lit});
}
TEST(TechniquesNightly, AnySubsetThatSupportsEveryPathHasTheSameMean) {
    expect_subsets_to_agree({"diffuse_box", testing::diffuse_box});
}

/// A cut light sub-path has no techniques beyond: they must leave the denominator, or the image darkens.
void expect_cuts_to_agree(std::initializer_list<Place> places) {
    TestFamily family;
    int cuts = 0, tested = 0;
    for (const Place& place : places) {
        const auto scene = place.make();
        const RegionMeans expected = reference(scene, 7, 32, {}, 40000);
        uint64_t seed = 41000;
        for (const AlgorithmInfo* row : catalog()) {
            const RowTechniques has = testing::techniques_of(*row, scene);
            if (row->traces != Traces::kBoth || !has.hit) continue;
            // A cache is shared by all pixels: one path through glass lights a whole block, and means are far from normal.
            if (row->learning && place.make == testing::glass_and_mirror) continue;
            for (const int vertices : {1, 2, 3, 5}) {
                if (vertices == 1 && !has.connect_to_light) continue;  // that is path tracing
                ++cuts;
                tested += testing::compare(expected, masked(scene, *row, {.max_light_vertices = vertices}, 7, 32, seed += 100),
                                           std::string(place.name) + ", " + std::string(row->name) + ", light sub-paths of " +
                                               std::to_string(vertices) + " vertices",
                                           &family);
            }
        }
    }
    EXPECT_GE(tested, cuts * 3 / 4) << "of " << cuts;
    family.check();
}

TEST(Techniques, LightSubPathsMayBeCutShort) {
    expect_cuts_to_agree({{"environment_lit", testing::environment_lit}, {"glass_and_mirror", testing::glass_and_mirror}});
}
TEST(TechniquesNightly, LightSubPathsMayBeCutShort) { expect_cuts_to_agree({{"diffuse_box", testing::diffuse_box}}); }

using Variant = std::map<std::string, std::string>;

/// Production parameters change the noise, never the mean. variants(row): what is compared with the defaults.
void expect_the_same_mean(const std::function<std::vector<Variant>(const AlgorithmInfo&)>& variants_of) {
    TestFamily family;
    const auto scene = testing::glossy();
    for (const AlgorithmInfo* row : catalog()) {
        const std::string name(row->name);
        std::vector<Variant> variants = variants_of(*row);
        variants.insert(variants.begin(), Variant());
        std::vector<RegionMeans> estimates;
        for (const auto& parameters : variants) {
            std::string what = name;
            for (const auto& [key, value] : parameters) what += " " + key + "=" + value;
            estimates.push_back(
                means(scene, testing::catalog_image(scene, name, 8, 16, parameters), 60000 + 1000 * uint64_t(estimates.size())));
            if (estimates.size() > 1) testing::compare(estimates.front(), estimates.back(), name + " and " + what, &family);
        }
    }
    family.check();
}

TEST(Techniques, RouletteAndConnectionsKeepTheMean) {
    expect_the_same_mean([](const AlgorithmInfo& row) -> std::vector<Variant> {
        const std::string name(row.name);
        return {testing::those_of(name, {{"rr-min", "1"}, {"connections", "3"}}),
                {{"rr-start", "2"}, {"rr-min", "0.05"}},
                testing::those_of(name, {{"rr-start", "2"}, {"rr-min", "0.6"}, {"connections", "1,4"}})};
    });
}

/// Every choice that a row offers beside its default.
TEST(TechniquesNightly, ChoicesKeepTheMean) {
    expect_the_same_mean([](const AlgorithmInfo& row) {
        const std::string name(row.name);
        std::vector<Variant> variants;
        const AlgorithmSettings usual = testing::settings_of(name, testing::with_small_training(name, {})).algorithm;
        for (const ParameterInfo& p : row.parameters)
            for (size_t c = 0; c < p.choices.size(); ++c)
                if (double(c) != usual.value(p.name)) variants.push_back({{std::string(p.name), std::string(p.choices[c])}});
        return variants;
    });
}

}  // namespace
}  // namespace lightloom
