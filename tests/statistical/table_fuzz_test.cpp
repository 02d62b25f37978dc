// No table may change the mean of an image: random classifiers, Gamma and Q, any number of connections, caches of two paths,
// windows, cut sub-paths, techniques switched off, all have the mean of the same scene without tables.
// [algorithms.md 6: table fuzz, tiny M, reuse, knock-out, truncation, single techniques]

#include <gtest/gtest.h>

#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::CacheOptions;
using testing::MaskedCacheSelection;
using testing::RandomTableOptions;
using testing::RegionMeans;
using testing::TestFamily;

constexpr int kSeeds = 64, kMaxDepth = 4;
constexpr uint32_t kSamplesPerPixel = 8;

using MakeScene = std::shared_ptr<const Scene> (*)();

RegionMeans means(const std::shared_ptr<const Scene>& scene, const testing::ImageOfSeed& image, uint64_t first_seed) {
    return testing::replicate(image, scene->frame().crop, kSeeds, first_seed);
}

RegionMeans reference(const std::shared_ptr<const Scene>& scene, const char* algorithm = "bdpt", int max_depth = kMaxDepth) {
    return means(scene, testing::catalog_image(scene, algorithm, max_depth, 16), 100);
}

struct Case {
    const char* name;
    MakeScene make;
    const char* reference;  ///< Of the mean: an algorithm that samples every path of the scene.
    /// A cache is shared by all pixels: one path through glass lights a whole block, and means over blocks are far from normal.
    bool frame_only = false;
};

constexpr Case kCases[] = {
    {"diffuse_box", testing::diffuse_box, "path"},
    {"glossy", testing::glossy, "bdpt"},
    {"textured_and_two_sided", testing::textured_and_two_sided, "path"},
    {"environment_lit", testing::environment_lit, "path"},
    {"delta_lights", testing::delta_lights, "path"},
    {"glass_and_mirror", testing::glass_and_mirror, "bdpt", true},
    {"smooth_normals_and_lens", testing::smooth_normals_and_lens, "bdpt"},
    {"spherical_lights", testing::spherical_lights, "path"},
};

bool compare(const Case& c, const RegionMeans& a, const RegionMeans& b, const std::string& what, TestFamily* family) {
    if (!c.frame_only) return testing::compare(a, b, what, family);
    family->add(testing::welch_p_value(a.frame(), b.frame()),
                what + ", frame: " + std::to_string(a.frame().mean) + " and " + std::to_string(b.frame().mean));
    return true;
}

/// Every N in 1..5, with and without the knowledge of the cache's size in the weights.
TEST(TableFuzz, RandomTablesKeepTheMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : kCases) {
        const auto scene = c.make();
        const RegionMeans expected = reference(scene, c.reference);
        for (int n = 1; n <= 5; ++n) {
            CacheOptions options;
            options.connections = n;
            options.ris_aware = n % 2 == 0, options.correlation_aware = n % 3 == 0;
            options.light_paths = n == 3 ? 0.4 : 1;  // N1 need not be one
            RandomTableOptions random;
            random.light_count = uint32_t(4 * n), random.eye_count = uint32_t(3 * n);
            random.spread = 3;  // wider tables are as unbiased, but noisier than a test can use
            const SubspaceTables tables = testing::random_tables(scene->emitters(), uint64_t(100 + n), random);
            const std::string what = std::string(c.name) + ", N = " + std::to_string(n);
            ++frames;
            tested += compare(
                c, expected,
                means(scene, testing::spcbpt_image(scene, tables, options, kMaxDepth, kSamplesPerPixel), 1000 * uint64_t(n)), what,
                &family);
            if (n % 2 == 0) continue;
            ++frames;
            tested +=
                compare(c, expected,
                        means(scene, testing::lvcbpt_image(scene, tables.vertices_per_path, options, kMaxDepth, kSamplesPerPixel),
                              20000 + 1000 * uint64_t(n)),
                        what + " of lvcbpt", &family);
        }
    }
    EXPECT_GE(tested, frames * 9 / 10);
    family.check();
}

/// What a normalisation by realised numbers would get wrong shows in caches of a few paths: -20 % with two [algorithms.md 1.5].
TEST(TableFuzz, TinyCachesKeepTheMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : {kCases[0], kCases[3], kCases[4]}) {
        const auto scene = c.make();
        const RegionMeans expected = reference(scene, c.reference);
        for (const uint64_t paths : {2, 5, 20}) {
            CacheOptions options;
            options.paths = paths;
            options.light_paths = 1e-9;  // the plan counts one path, the cache has M
            RandomTableOptions random;
            random.light_count = 6, random.eye_count = 4, random.spread = 2;
            const std::string what = std::string(c.name) + ", M = " + std::to_string(paths);
            const SubspaceTables tables = testing::random_tables(scene->emitters(), 300 + paths, random);
            // One light path in a unit splats too rarely for a test, so light tracing is switched off. A whole unit shares its
            // few paths, so that a replication is many units, here rows of the frame.
            MaskedCacheSelection<SubspaceSelection> spc{testing::subspace_selection(*scene, tables, options)};
            MaskedCacheSelection<UniformSelection> lvc{
                {1, options.connections / tables.vertices_per_path, TypicalSurvival(RouletteRule{})}};
            spc.light_tracing = lvc.light_tracing = false;
            const auto in_rows = [&](const auto& algorithm) {
                return [&scene, algorithm](uint64_t seed) {
                    const Rect crop = scene->frame().crop;
                    std::vector<double> image(size_t(crop.area()), 0.0);
                    constexpr uint64_t kRounds = 16;
                    RenderSettings settings;
                    settings.seed = seed, settings.max_depth = kMaxDepth;
                    for (uint64_t round = 0; round < kRounds; ++round)
                        for (int row = crop.y0; row < crop.y1; ++row) {
                            const uint64_t unit = round * uint64_t(crop.height()) + uint64_t(row - crop.y0);
                            const UnitWork work{round, 1, round, Rect{crop.x0, row, crop.x1, row + 1}, unit, 1};
                            const Result<Partial> part = render_unit(algorithm, *scene, settings, {}, work, {});
                            if (!part.ok()) throw std::runtime_error(part.status().message());
                            const std::vector<double> pixels = testing::develop(*part, crop);
                            for (size_t i = 0; i < image.size(); ++i) image[i] += pixels[i] / double(kRounds);
                        }
                    return image;
                };
            };
            frames += 2;
            const SpcbptAlgorithm<MaskedCacheSelection<SubspaceSelection>> subspaces{{spc, 3}, Heuristic::kBalance, paths};
            const LvcbptAlgorithm<MaskedCacheSelection<UniformSelection>> uniform{{lvc, 3}, Heuristic::kBalance, paths};
            tested += compare(c, expected, means(scene, in_rows(subspaces), 5000), "spcbpt, " + what, &family);
            tested += compare(c, expected, means(scene, in_rows(uniform), 7000), "lvcbpt, " + what, &family);
        }
    }
    EXPECT_GE(tested, frames * 2 / 3) << "of " << frames;
    family.check();
}

/// Windows of light-only paths: a fixed one, and a random one for every subspace.
TEST(TableFuzz, WindowsKeepTheMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : {kCases[0], kCases[2], kCases[3], kCases[5]}) {
        const auto scene = c.make();
        const RegionMeans expected = reference(scene, c.reference);
        for (const int fixed : {5, 0}) {
            CacheOptions options;
            options.paths = 50;
            options.light_paths = 50 / (double(kSamplesPerPixel) * double(scene->frame().crop.area()));
            RandomTableOptions random;
            random.max_window = 9;
            random.light_count = 16, random.spread = 2;
            SubspaceTables tables = testing::random_tables(scene->emitters(), 400, random);
            if (fixed > 0) tables.window.assign(tables.window.size(), uint16_t(fixed));
            MaskedCacheSelection<SubspaceSelection> selection{testing::subspace_selection(*scene, tables, options)};
            // Fifty light paths in a replication splat too little for a test.
            selection.light_tracing = c.reference == std::string("bdpt");
            const SpcbptAlgorithm<MaskedCacheSelection<SubspaceSelection>> algorithm{
                {selection, options.connections}, Heuristic::kBalance, options.paths};
            ++frames;
            tested += compare(
                c, expected,
                means(scene, testing::cache_image(scene, algorithm, kMaxDepth, kSamplesPerPixel, options.light_paths), 3000),
                std::string(c.name) + (fixed > 0 ? ", J = 5" : ", random J"), &family);
        }
    }
    EXPECT_GE(tested, frames / 2) << "of " << frames;
    family.check();
}

/// One technique per run, for one path length: its weight is one, and the image is f / p of that technique.
TEST(TableFuzz, EachTechniqueAloneHasTheSameMean) {
    TestFamily family;
    int pairs = 0, tested = 0;
    for (const auto& [name, make] :
         {std::pair<const char*, MakeScene>{"lamp", testing::apart_with_lamp}, {"sky", testing::apart_with_sky}}) {
        const auto scene = make();
        for (int k = 2; k <= 4; ++k) {
            testing::MaskedSelection nee{testing::bdpt_selection(*scene)};
            nee.only_s = 1;
            nee.min_k = nee.max_k = k;
            const RegionMeans expected =
                means(scene, testing::algorithm_image(scene, BdptAlgorithm<testing::MaskedSelection>{nee}, k - 1, 16), 10000);
            CacheOptions options;
            options.paths = 8000;
            RandomTableOptions random;
            random.light_count = 5, random.eye_count = 4, random.spread = 2, random.max_window = 2;
            const SubspaceTables tables = testing::random_tables(scene->emitters(), 500 + uint64_t(k), random);
            for (int s = 1; s <= k; ++s) {
                MaskedCacheSelection<SubspaceSelection> spc{testing::subspace_selection(*scene, tables, options)};
                MaskedCacheSelection<UniformSelection> lvc{
                    {double(scene->frame().crop.area()), 1.7, TypicalSurvival(RouletteRule{})}};
                spc.only_s = lvc.only_s = s;
                spc.min_k = spc.max_k = lvc.min_k = lvc.max_k = k;
                const SpcbptAlgorithm<MaskedCacheSelection<SubspaceSelection>> subspaces{
                    {spc, 3}, Heuristic::kBalance, options.paths};
                const LvcbptAlgorithm<MaskedCacheSelection<UniformSelection>> uniform{{lvc, 3}, Heuristic::kBalance, options.paths};
                const std::string what = std::string(name) + ", k = " + std::to_string(k) + ", s = " + std::to_string(s);
                pairs += 2;
                tested += testing::compare(expected, means(scene, testing::cache_image(scene, subspaces, k - 1, 8, 1), 11000),
                                           "spcbpt, " + what, &family);
                tested += testing::compare(expected, means(scene, testing::cache_image(scene, uniform, k - 1, 8, 1), 12000),
                                           "lvcbpt, " + what, &family);
            }
        }
    }
    EXPECT_GE(tested, pairs * 3 / 4) << "of " << pairs;
    family.check();
}

/// Subsets of {hits, connections, light tracing} that still sample every path, and light sub-paths that are cut short.
TEST(TableFuzz, FewerTechniquesHaveTheSameMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : {kCases[0], kCases[3]}) {
        const auto scene = c.make();
        const auto image = [&](auto change, int max_depth, int min_k) {
            CacheOptions options;
            options.paths = 4000;
            RandomTableOptions random;
            random.light_count = 8, random.eye_count = 6, random.spread = 2;
            MaskedCacheSelection<SubspaceSelection> selection{
                testing::subspace_selection(*scene, testing::random_tables(scene->emitters(), 600, random), options)};
            selection.min_k = min_k;
            change(selection);
            const SpcbptAlgorithm<MaskedCacheSelection<SubspaceSelection>> algorithm{
                {selection, options.connections}, Heuristic::kBalance, options.paths};
            return testing::cache_image(scene, algorithm, max_depth, kSamplesPerPixel, 1);
        };
        testing::MaskedSelection all{testing::bdpt_selection(*scene)};
        all.min_k = 2;
        const RegionMeans indirect =
            means(scene, testing::algorithm_image(scene, BdptAlgorithm<testing::MaskedSelection>{all}, kMaxDepth, 16), 20000);
        for (const int mask : {2, 3, 4, 5, 6, 7}) {
            const auto subset = image(
                [mask](auto& s) { s.hits = mask & 1, s.connections_on = mask & 2, s.light_tracing = mask & 4; }, kMaxDepth, 2);
            ++frames;
            tested += testing::compare(indirect, means(scene, subset, 21000 + 100 * uint64_t(mask)),
                                       std::string(c.name) + ", techniques " + std::to_string(mask), &family);
        }
        const RegionMeans deep = reference(scene, "bdpt", 7);
        for (const int vertices : {1, 2, 3, 5}) {
            const auto cut = image([vertices](auto& s) { s.max_light_vertices = vertices; }, 7, 1);
            ++frames;
            tested +=
                testing::compare(deep, means(scene, cut, 23000 + 100 * uint64_t(vertices)),
                                 std::string(c.name) + ", light sub-paths of " + std::to_string(vertices) + " vertices", &family);
        }
    }
    EXPECT_GE(tested, frames * 3 / 4) << "of " << frames;
    family.check();
}

/// The realised energy of a cache is Q in expectation, whatever the windows: E[sum_i R_i / M_i] = sum_i Q_i, where Q comes from
/// independent paths. R_i / (M_i N) is what a unit's samples are scaled by.
TEST(TableFuzz, CountedEnergyIsTheExpectedOne) {
    for (const Case& c : {kCases[0], kCases[2], kCases[3], kCases[4], kCases[5]}) {
        const auto scene = c.make();
        RenderSettings settings{"spcbpt", {}, 4242, kMaxDepth};
        const Result<TrainingData> data = trace_training(*scene, settings, {0, 20000, 20000}, {});
        ASSERT_TRUE(data.ok());
        RandomTableOptions random;
        random.max_window = 6;
        const SubspaceTables tables = testing::random_tables(scene->emitters(), 700, random);
        const uint32_t n = tables.light_count;
        // Per light path and subspace, in batches of paths: Q and its error from a source of its own.
        const SubspaceLabeller labeller{tables, scene->emitters()};
        std::vector<std::vector<double>> expected(n + 1), counted(n + 1);
        const size_t batch = data->light_paths.size() / kSeeds;
        for (size_t b = 0; b < size_t(kSeeds); ++b) {
            std::vector<double> sum(n + 1, 0.0);
            for (size_t m = b * batch; m < (b + 1) * batch; ++m) {
                const TrainingPath& p = data->light_paths[m];
                const TrainingVertex* v = &data->vertices[p.first_vertex];
                for (uint32_t i = 0; i < p.vertex_count; ++i) {
                    if (!(v[i].density > 0)) continue;
                    const uint32_t label = i == 0 ? labeller.source(v[0].emitter, v[0].position, v[0].normal)
                                                  : tables.light_label(sub_path_end(v[i].position, v[i].normal,
                                                                                    normalize(v[i - 1].position - v[i].position)));
                    sum[label] += double(v[i].density);
                    sum[n] += double(v[i].density);
                }
            }
            // Camera samples whose light sub-path found nothing count as well.
            for (uint32_t i = 0; i <= n; ++i)
                expected[i].push_back(sum[i] / double(batch) * double(data->light_paths.size()) / double(data->samples));
        }
        CacheOptions options;
        options.paths = 200;
        const SpcbptAlgorithm<> algorithm{
            {testing::subspace_selection(*scene, tables, options), options.connections}, Heuristic::kBalance, options.paths};
        for (int seed = 0; seed < kSeeds; ++seed) {
            const UnitWork work = testing::frame_with_paths(*scene, 1, 0);
            UnitPreparation preparation;
            const auto state = algorithm.prepare({*scene, uint64_t(31000 + seed), kMaxDepth + 1, {}, work, {}}, &preparation);
            ASSERT_EQ(state.index.subspaces.size(), n);
            double total = 0;
            for (uint32_t i = 0; i < n; ++i) {
                counted[i].push_back(double(state.index.subspaces[i].scale) * options.connections);
                total += counted[i].back();
            }
            counted[n].push_back(total);
        }
        for (uint32_t i = 0; i <= n; ++i) {
            const testing::Sample a(expected[i]), b(counted[i]);
            if (a.mean == 0 && b.mean == 0) continue;
            // Subspaces with a prefix here and there are anything but normal.
            if (i < n && std::max(a.relative_error(), b.relative_error()) > 0.1) continue;
            EXPECT_LT(std::fabs(a.mean - b.mean), 4 * std::sqrt(a.variance + b.variance) + 1e-6 * a.mean)
                << c.name << (i == n ? ", all subspaces" : ", subspace " + std::to_string(i)) << ": " << a.mean << " and "
                << b.mean;
        }
    }
}

}  // namespace
}  // namespace lightloom
