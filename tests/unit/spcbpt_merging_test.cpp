// `spcbpt` with merging=on: without its merges it is spcbpt bit for bit; its bytes do not depend on threads; its units are whole
// frames; training counts its merges; bad input gives a clear line.

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "common/transport/training.h"
#include "common/work/job.h"
#include "tests/support/row_render.h"
#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::Parameters;

RenderSettings settings_of(Parameters parameters) {
    parameters.merge(Parameters{{"cache", "3000"}, {"merge-radius", "2"}});
    return testing::settings_of("spcbpt", parameters, 7);
}

Partial render(const std::shared_ptr<const Scene>& scene, const Parameters& parameters, const TechniqueMask* mask = nullptr,
               uint32_t iterations = 1) {
    const RenderSettings settings = settings_of(parameters);
    const Tables tables = testing::random_tables_for(settings.algorithm.info(), *scene, 3);
    const auto renderer = Renderer::create(scene, settings, tables, mask);
    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
    Result<Partial> partial = (*renderer)->render(testing::whole_frame(*scene, settings.algorithm, iterations), {});
    if (!partial.ok()) throw std::runtime_error(partial.status().message());
    EXPECT_EQ(partial->dropped_count, 0u);
    return *std::move(partial);
}

double mean_of(const Partial& partial, const Scene& scene) {
    double sum = 0;
    for (const double v : testing::develop(partial, scene.frame().crop)) sum += v;
    return sum / double(scene.frame().crop.area());
}

/// Cache, camera sub-paths, connections and weights are those of spcbpt; only merging comes on top.
TEST(SpcbptMerging, WithoutMergesIsSpcbptBitForBit) {
    const TechniqueMask no_merges = TechniqueMask::without(TechniqueKind::kMerge);
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        testing::expect_identical(render(scene, {{"merging", "on"}}, &no_merges), render(scene, {}), named.name);
    }
}

TEST(SpcbptMerging, BytesDoNotDependOnThreads) {
    const auto scene = testing::glass_and_mirror();
    const auto with_threads = [&](int threads) {
        std::optional<Partial> partial;
        tbb::task_arena(threads).execute([&] { partial = render(scene, {{"merging", "on"}}, nullptr, 3); });
        return *std::move(partial);
    };
    const Partial one = with_threads(1);
    testing::expect_identical(one, with_threads(2), "two threads");
    testing::expect_identical(one, with_threads(5), "five threads");
}

/// Progressive photon mapping is all that is left when merges are: they find all light but that of visible lamps, up to what edges
/// and the kernel take. Mutations: n off by a factor, the kernel's area, survival of roulette twice.
TEST(SpcbptMerging, MergesCarryLight) {
    const auto scene = testing::diffuse_box();
    TechniqueMask merges{.min_k = 2}, everything{.min_k = 2};
    for (int kind = 0; kind < kTechniqueKinds; ++kind) merges.on[kind] = kind == int(TechniqueKind::kMerge);
    const double expected = mean_of(render(scene, {}, &everything, 16), *scene);
    for (const char* kernel : {"constant", "epanechnikov"}) {
        const Parameters on{{"merging", "on"}, {"merge-first", "on"}, {"kernel", kernel}};
        EXPECT_NEAR(mean_of(render(scene, on, &merges, 16), *scene) / expected, 1, 0.1) << kernel;
        EXPECT_NEAR(mean_of(render(scene, on, &everything, 16), *scene) / expected, 1, 0.1) << kernel;
    }
}

TEST(SpcbptMerging, UnitsAreWholeFramesIfItMerges) {
    const auto scene = testing::diffuse_box();
    for (const bool on : {false, true}) {
        const RenderSettings settings = settings_of({{"merging", on ? "on" : "off"}});
        EXPECT_EQ(settings.algorithm.merges(), on);
        FrameLayout large = scene->frame();
        large.width = large.height = 2000;
        large.crop = {0, 0, 2000, 2000};
        EXPECT_EQ(Plan(large, settings.algorithm).tile_count() == 1, on);
        const auto renderer = Renderer::create(scene, settings, testing::random_tables_for(settings.algorithm.info(), *scene, 3));
        ASSERT_TRUE(renderer.ok()) << renderer.status().message();
        RenderUnit tile{.iteration_count = 1, .tile = scene->frame().crop, .light_path_count = 100};
        tile.tile.x1 -= 5;
        EXPECT_EQ((*renderer)->render(tile, {}).ok(), !on);
    }
}

/// What merges will find needs no Gamma: their densities are among those that it does not change, and grow with the disc.
TEST(SpcbptMerging, TrainingCountsMerges) {
    const auto scene = testing::glass_and_mirror();
    const auto fixed = [&](const Parameters& parameters) {
        double sum = 0;
        const TrainingData data = testing::trace_training(*scene, settings_of(parameters), {0, 1024, 1024});
        for (const TrainingPath& path : data.paths) sum += double(path.lens) * double(path.estimate);
        return sum;
    };
    const double without = fixed({});
    EXPECT_EQ(fixed({{"merge-radius", "5"}}), without);
    const double small = fixed({{"merging", "on"}, {"merge-radius", "1"}}),
                 large = fixed({{"merging", "on"}, {"merge-radius", "2"}});
    EXPECT_GT(small, without);
    // Mostly four times as much; correlation bounds it, and the disc may reach the scene's radius.
    EXPECT_GT(large - without, 1.5 * (small - without));
    EXPECT_LE(large - without, 4.05 * (small - without));
}

TEST(SpcbptMerging, RadiiThatAreNoneAreRefused) {
    for (const char* radius : {"0", "-1", "nan", "1001"}) {
        EXPECT_EQ(AlgorithmSettings::parse("spcbpt", {{"merging", "on"}, {"merge-radius", radius}}).status().message(),
                  "parameter merge-radius=" + std::string(radius) + " of 'spcbpt' must be a number from 0.001 to 1000");
    }
    EXPECT_EQ(AlgorithmSettings::parse("spcbpt", {{"merging", "yes"}}).status().message(),
              "parameter merging=yes of 'spcbpt' must be off or on");
}

/// A disc as large as the scene blurs everything, but nothing breaks.
TEST(SpcbptMerging, RadiiAsLargeAsTheSceneGiveFiniteImages) {
    const auto scene = testing::glass_and_mirror();
    const double mean =
        mean_of(render(scene, {{"merging", "on"}, {"merge-radius", "1000"}, {"cache", "50"}, {"light-paths", "0.02"}}), *scene);
    EXPECT_TRUE(std::isfinite(mean));
    EXPECT_GT(mean, 0);
}

}  // namespace
}  // namespace lightloom
