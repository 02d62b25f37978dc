// No table may change the mean of an image: random classifiers, Gamma and Q, any number of connections, caches of two paths and
// windows all have the mean of the same scene without tables, for every row of the catalog that learns. (technique_test leaves
// techniques out of them.) [common/path/README.md, "What would bias"]

#include <gtest/gtest.h>

#include "common/transport/spcbpt.h"
#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::CacheOptions;
using testing::RandomTableOptions;
using testing::RegionMeans;
using testing::TestFamily;

constexpr int kSeeds = 64, kMaxDepth = 4;
constexpr uint32_t kSamplesPerPixel = 8;

using MakeScene = std::shared_ptr<const Scene> (*)();

RegionMeans means(const std::shared_ptr<const Scene>& scene, const testing::ImageOfSeed& image, uint64_t first_seed) {
    return testing::replicate(image, scene->frame().crop, kSeeds, first_seed);
}

RegionMeans reference(const std::shared_ptr<const Scene>& scene, const char* algorithm) {
    return means(scene, testing::catalog_image(scene, algorithm, kMaxDepth, 16), 100);
}

/// The rows that learn and have the parameter.
std::vector<const AlgorithmInfo*> rows_with(std::string_view parameter) {
    std::vector<const AlgorithmInfo*> rows;
    for (const AlgorithmInfo* row : catalog())
        if (row->learning && testing::settings_of(std::string(row->name)).algorithm.has(parameter)) rows.push_back(row);
    return rows;
}

/// The tables with so many windows for every subspace, where they have subspaces.
Tables with_windows(const Tables& tables, int count) {
    Tables changed = tables;
    if (const auto subspaces = tables.get<SubspaceTables>()) {
        SubspaceTables fixed = *subspaces;
        fixed.window.assign(fixed.window.size(), uint16_t(count));
        changed.set(std::make_shared<const SubspaceTables>(std::move(fixed)));
    }
    return changed;
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

/// Every N in 1..5, at the first hit and in reverse order at later ones, with and without the knowledge of the cache's size in the
/// weights.
TEST(TableFuzz, RandomTablesKeepTheMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : kCases) {
        const auto scene = c.make();
        const RegionMeans expected = reference(scene, c.reference);
        for (const AlgorithmInfo* row : catalog()) {
            if (!row->learning || !testing::complete(*row, "path bdpt")) continue;
            const std::string algorithm(row->name);
            const bool connects = testing::settings_of(algorithm).algorithm.has("connections");
            for (int n = 1; n <= (connects ? 5 : 1); ++n) {
                CacheOptions options;
                options.connections = {n, 6 - n};
                options.ris_aware = n % 2 == 0, options.correlation_aware = n % 3 == 0;
                options.light_paths = n == 3 ? 0.4 : 1;  // N1 need not be one
                RandomTableOptions random;
                random.light_count = uint32_t(4 * n), random.eye_count = uint32_t(3 * n);
                random.spread = 3;  // wider tables are as unbiased, but noisier than a test can use
                const Tables tables = testing::random_tables_for(*row, *scene, uint64_t(100 + n), random);
                const auto image =
                    testing::table_image(scene, testing::cache_settings(algorithm, options, kMaxDepth), tables, kSamplesPerPixel);
                ++frames;
                tested += compare(c, expected, means(scene, image, 1000 * uint64_t(n)),
                                  std::string(c.name) + ", " + algorithm + ", N = " + std::to_string(n), &family);
            }
        }
    }
    EXPECT_GE(tested, frames * 9 / 10);
    family.check();
}

/// What a normalisation by realised numbers would get wrong shows in caches of a few paths: some -20 % with two
/// [common/path/README.md, "What would bias"].
TEST(TableFuzz, TinyCachesKeepTheMean) {
    TestFamily family;
    int frames = 0, tested = 0;
    for (const Case& c : {kCases[0], kCases[3], kCases[4]}) {
        const auto scene = c.make();
        const RegionMeans expected = reference(scene, c.reference);
        for (const AlgorithmInfo* row : rows_with("cache")) {
            if (row->frame != FrameShape::kTiles) continue;
            for (const uint64_t paths : {2, 5, 20}) {
                CacheOptions options;
                options.paths = paths;
                options.light_paths = 0.001;
                options.connections = {2, 4};
                RandomTableOptions random;
                random.light_count = 6, random.eye_count = 4, random.spread = 2;
                const std::string algorithm(row->name);
                RenderSettings settings = testing::cache_settings(algorithm, options, kMaxDepth);
                const Tables tables = testing::random_tables_for(*row, *scene, 300 + paths, random);
                // The plan counts one path, the cache has M. One light path in a unit splats too rarely for a test, so light
                // tracing is switched off. A whole unit shares its few paths, so that a replication is many units, here rows of the
                // frame.
                const TechniqueMask mask = TechniqueMask::without(TechniqueKind::kLens);
                const auto in_rows = [&](uint64_t seed) {
                    settings.seed = seed;
                    const auto renderer = Renderer::create(scene, settings, tables, &mask);
                    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
                    const Rect crop = scene->frame().crop;
                    std::vector<double> image(size_t(crop.area()), 0.0);
                    constexpr uint64_t kRounds = 16;
                    for (uint64_t round = 0; round < kRounds; ++round)
                        for (int y = crop.y0; y < crop.y1; ++y) {
                            const uint64_t unit = round * uint64_t(crop.height()) + uint64_t(y - crop.y0);
                            const RenderUnit work{round, 1, round, Rect{crop.x0, y, crop.x1, y + 1}, unit, 1};
                            const std::vector<double> pixels = testing::image_of(renderer, *scene, work);
                            for (size_t i = 0; i < image.size(); ++i) image[i] += pixels[i] / double(kRounds);
                        }
                    return image;
                };
                ++frames;
                tested += compare(c, expected, means(scene, in_rows, 5000),
                                  algorithm + ", " + std::string(c.name) + ", M = " + std::to_string(paths), &family);
            }
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
        for (const AlgorithmInfo* row : rows_with("windows")) {
            for (const int fixed : {5, 0}) {
                CacheOptions options;
                options.paths = 50;
                options.light_paths = 50 / (double(kSamplesPerPixel) * double(scene->frame().crop.area()));
                RandomTableOptions random;
                random.max_window = 9;
                random.light_count = 16, random.spread = 2;
                const Tables tables = testing::random_tables_for(*row, *scene, 400, random);
                TechniqueMask mask;
                // Fifty light paths in a replication splat too little for a test.
                mask.on[int(TechniqueKind::kLens)] = c.reference == std::string("bdpt");
                const std::string algorithm(row->name);
                const auto image = testing::table_image(scene, testing::cache_settings(algorithm, options, kMaxDepth),
                                                        fixed > 0 ? with_windows(tables, fixed) : tables, kSamplesPerPixel, mask);
                ++frames;
                tested += compare(c, expected, means(scene, image, 3000),
                                  algorithm + ", " + std::string(c.name) + (fixed > 0 ? ", J = 5" : ", random J"), &family);
            }
        }
    }
    EXPECT_GE(tested, frames / 2) << "of " << frames;
    family.check();
}

/// The realised energy of a cache is Q in expectation, whatever the windows: E[sum_i R_i / M_i] = sum_i Q_i, where Q comes from
/// independent paths. R_i / (M_i N) is what a unit's samples are scaled by.
TEST(TableFuzz, CountedEnergyIsTheExpectedOne) {
    for (const Case& c : {kCases[0], kCases[2], kCases[3], kCases[4], kCases[5]}) {
        const auto scene = c.make();
        const RenderSettings settings = testing::settings_of("spcbpt", {}, 4242, kMaxDepth);
        const TrainingData data = testing::trace_training(*scene, settings, {0, 20000, 20000});
        RandomTableOptions random;
        random.max_window = 6;
        const SubspaceTables tables = testing::random_tables(scene->emitters(), 700, random);
        const uint32_t n = tables.light_count;
        // Per light path and subspace, in batches of paths: Q and its error from a source of its own.
        const SubspaceLabeller labeller{tables, scene->emitters()};
        std::vector<std::vector<double>> expected(n + 1), counted(n + 1);
        const size_t batch = data.light_paths.size() / kSeeds;
        for (size_t b = 0; b < size_t(kSeeds); ++b) {
            std::vector<double> sum(n + 1, 0.0);
            for (size_t m = b * batch; m < (b + 1) * batch; ++m) {
                const TrainingPath& p = data.light_paths[m];
                const TrainingVertex* v = &data.vertices[p.first_vertex];
                for (uint32_t i = 0; i < p.vertex_count; ++i) {
                    if (!(v[i].density > 0)) continue;
                    const uint32_t label = i == 0 ? labeller.source(p.emitter, v[0].position, v[0].normal)
                                                  : tables.light_label(sub_path_end(v[i].position, v[i].normal,
                                                                                    normalize(v[i - 1].position - v[i].position)));
                    sum[label] += double(v[i].density);
                    sum[n] += double(v[i].density);
                }
            }
            // Camera samples whose light sub-path found nothing count as well.
            for (uint32_t i = 0; i <= n; ++i)
                expected[i].push_back(sum[i] / double(batch) * double(data.light_paths.size()) / double(data.samples));
        }
        constexpr int kConnections = 3;
        const auto prepared = std::make_shared<const PreparedTables>(tables);
        const SpcbptAlgorithm<> algorithm{
            {spcbpt_selection(prepared, {.connections = kConnections}), prepared, kConnections}, Heuristic::kBalance, 200};
        for (int seed = 0; seed < kSeeds; ++seed) {
            const RenderUnit work = testing::whole_frame(*scene, 1, 1);
            UnitPreparation preparation;
            const auto state =
                algorithm.prepare({*scene, uint64_t(31000 + seed), kMaxDepth + 1, {}, work, {}}, &preparation, AnyContribute{});
            ASSERT_EQ(state.index.subspaces.size(), n);
            double total = 0;
            for (uint32_t i = 0; i < n; ++i) {
                counted[i].push_back(double(state.index.subspaces[i].scale.at_first) * kConnections);
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
