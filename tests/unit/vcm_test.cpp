// `vcm`: without merges it is bdpt bit for bit; its radius and kernels are what they say; bad input gives a clear line or the right
// image.

#include <gtest/gtest.h>

#include "common/transport/vcm.h"
#include "tests/support/row_render.h"
#include "tests/support/small_scenes.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::Parameters;
using testing::SceneBuilder;

Partial render(const std::shared_ptr<const Scene>& scene, const std::string& algorithm, const Parameters& parameters,
               const TechniqueMask* mask = nullptr, uint32_t iterations = 1) {
    const RenderSettings settings = testing::settings_of(algorithm, parameters, 7);
    const auto renderer = Renderer::create(scene, settings, {}, mask);
    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
    Result<Partial> partial = (*renderer)->render(testing::whole_frame(*scene, settings.algorithm, iterations), {});
    if (!partial.ok()) throw std::runtime_error(partial.status().message());
    EXPECT_EQ(partial->dropped_count, 0u);
    return *std::move(partial);
}

double mean_of(const Partial& partial, const Scene& scene) {
    double sum = 0;
    for (const double v : testing::develop(partial, scene.frame().crop)) {
        EXPECT_TRUE(std::isfinite(v));
        sum += v;
    }
    return sum / double(scene.frame().crop.area());
}

/// Light sub-paths, camera sub-paths, connections and weights are those of bdpt; only merging comes on top.
TEST(Vcm, WithoutMergesIsBdptBitForBit) {
    const TechniqueMask no_merges = TechniqueMask::without(TechniqueKind::kMerge);
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        testing::expect_identical(render(scene, "vcm", {}, &no_merges), render(scene, "bdpt", {}), named.name);
    }
}

TEST(Vcm, MergesCarryLight) {
    const auto scene = testing::diffuse_box();
    TechniqueMask merges;
    for (int kind = 0; kind < kTechniqueKinds; ++kind) merges.on[kind] = kind == int(TechniqueKind::kMerge);
    const double expected = mean_of(render(scene, "bdpt", {}, nullptr, 16), *scene);
    // Merges alone, at the first hit as well, are progressive photon mapping: they find all light but that of visible lamps, up to
    // what edges and the kernel take.
    const TechniqueMask visible{.max_k = 1};
    const double lamps = mean_of(render(scene, "bdpt", {}, &visible, 16), *scene);
    for (const char* kernel : {"constant", "epanechnikov"}) {
        const double found =
            mean_of(render(scene, "vcm", {{"merge-first", "on"}, {"kernel", kernel}, {"merge-radius", "2"}}, &merges, 16), *scene);
        EXPECT_NEAR(found / (expected - lamps), 1, 0.1) << kernel;
    }
}

TEST(Vcm, KernelsIntegrateToOneAndSayTheirArea) {
    for (const MergeKernel kind : {MergeKernel::kConstant, MergeKernel::kEpanechnikov}) {
        const double radius = 0.3;
        double sum = 0, square = 0;
        constexpr int kRings = 100000;
        for (int i = 0; i < kRings; ++i) {
            const double a = radius * i / kRings, b = radius * (i + 1) / kRings, middle = (a + b) / 2;
            const double value = double(kernel(kind, float(middle * middle), float(radius * radius)));
            sum += value * kPiD * (b * b - a * a);
            square += value * value * kPiD * (b * b - a * a);
        }
        EXPECT_NEAR(sum, 1, 1e-4);
        PathView view;
        view.k = 5, view.fwd[0] = view.next_event = 1;
        const VcmSelection selection{{1000}, {.fixed2 = radius * radius, .most2 = 1}, kind, false};
        EXPECT_NEAR(selection.on(view).merge(1), 1000 / square, 1e-2 / square);
    }
}

TEST(Vcm, MergesAtTheFirstHitAreAChoice) {
    PathView view;
    view.k = 4, view.fwd[0] = view.next_event = 1, view.footprint_distance2 = 4;
    const MergeRadius radius{.per_distance2 = 1e-4, .most2 = 100};
    for (const bool first_hit : {false, true}) {
        const auto on = VcmSelection{{10}, radius, MergeKernel::kConstant, first_hit}.on(view);
        for (const int i : {1, 2}) EXPECT_NEAR(on.merge(i), 10 * kPiD * 4e-4, 1e-12);
        EXPECT_EQ(on.merge(3) > 0, first_hit);
    }
}

/// The radius follows the first vertex that is neither mirror nor glass, and never exceeds the scene's.
TEST(Vcm, RadiusFollowsTheFootprint) {
    std::vector<PathVertex> z(5);
    z[1].p = {0, 0, 2}, z[2].p = {0, 3, 2}, z[3].p = {1, 3, 2}, z[4].p = {9, 3, 2};
    EXPECT_FLOAT_EQ(float(camera_distance2(z.data(), 2)), 4);
    EXPECT_FLOAT_EQ(float(camera_distance2(z.data(), 5)), 4);
    z[1].delta = z[2].delta = true;
    EXPECT_FLOAT_EQ(float(camera_distance2(z.data(), 2)), 4);
    EXPECT_FLOAT_EQ(float(camera_distance2(z.data(), 3)), 25);
    EXPECT_FLOAT_EQ(float(camera_distance2(z.data(), 5)), 36);
    const MergeRadius radius{.per_distance2 = 0.25, .fixed2 = 1, .most2 = 4};
    EXPECT_EQ(radius.squared(4), 2);
    EXPECT_EQ(radius.squared(1e9), 4);
    EXPECT_EQ(radius.scaled(0.5).squared(4), 1);
}

TEST(Vcm, RadiiThatAreNoneAreRefused) {
    for (const char* radius : {"0", "-1", "nan", "1001", ""}) {
        const Status refused = AlgorithmSettings::parse("vcm", {{"merge-radius", radius}}).status();
        EXPECT_EQ(refused.message(),
                  "parameter merge-radius=" + std::string(radius) + " of 'vcm' must be a number from 0.001 to 1000");
    }
    EXPECT_EQ(AlgorithmSettings::parse("vcm", {{"merge-radius-unit", "metre"}}).status().message(),
              "parameter merge-radius-unit=metre of 'vcm' must be pixel or scene");
}

TEST(Vcm, HeuristicsOfMergesAreRefusedWithoutMerges) {
    for (const char* name : {"jendersie19", "vcm+", "vcm*"}) {
        EXPECT_EQ(AlgorithmSettings::parse("vcm", {{"techniques", "no-merge"}, {"heuristic", name}}).status().message(),
                  std::string("heuristic=") + name +
                      " of 'vcm' weights merges, of which techniques=no-merge leaves none; choose balance");
        EXPECT_TRUE(AlgorithmSettings::parse("vcm", {{"techniques", "no-lens"}, {"heuristic", name}}).ok());
    }
    EXPECT_TRUE(AlgorithmSettings::parse("vcm", {{"techniques", "no-merge"}}).ok());
}

/// A disc as large as the scene blurs everything, but nothing breaks.
TEST(Vcm, RadiiAsLargeAsTheSceneGiveFiniteImages) {
    const auto scene = testing::glass_and_mirror();
    for (const char* unit : {"pixel", "scene"})
        EXPECT_GT(
            mean_of(render(scene, "vcm", {{"merge-radius", "1000"}, {"merge-radius-unit", unit}, {"light-paths", "0.05"}}), *scene),
            0);
}

/// Where nothing can merge, the image is bdpt's.
TEST(Vcm, WithoutPlacesToMergeIsBdpt) {
    SceneBuilder mirrors, dark;
    Material mirror;
    mirror.kind = MaterialKind::kConductor;
    mirror.reflectance = mirrors.constant(Rgb(0.9f));
    mirrors.room({-1, -1, -1}, {1, 1, 1}, mirrors.add(mirror));
    mirrors.sphere({0, 0.3f, 0}, 0.2f, mirrors.diffuse(Rgb(0.0f)), mirrors.emission(Rgb(5.0f)));
    mirrors.look({0, 0, -0.9f}, {0, 0, 1}, 60);
    const auto scene = mirrors.build();
    testing::expect_identical(render(scene, "vcm", {}), render(scene, "bdpt", {}), "mirrors alone");

    dark.room({-1, -1, -1}, {1, 1, 1}, dark.diffuse(Rgb(0.5f)));
    dark.look({0, 0, -0.9f}, {0, 0, 1}, 60);
    const auto without_lights = dark.build();
    EXPECT_EQ(mean_of(render(without_lights, "vcm", {}), *without_lights), 0);
}

}  // namespace
}  // namespace lightloom
