// Light that only a chance hit of a lamp finds: a pool under a lamp. With a large lamp the truth can be rendered, with a small one
// the estimate has to say that nothing was found yet.

#include "common/film/rare_light.h"

#include <gtest/gtest.h>

#include "common/transport/rare_light.h"
#include "tests/support/estimates.h"
#include "tests/support/hits_only.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

enum class Lamp { kLarge, kSmall, kPoint, kHidden };

/// Looks through the surface of a pool at its floor; `water` false: an empty one.
std::shared_ptr<const Scene> pool(Lamp lamp, bool water = true) {
    testing::SceneBuilder b;
    const MaterialId floor = b.diffuse({0.5f, 0.6f, 0.65f});
    b.quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, floor);
    if (water) {
        Material m;
        m.kind = MaterialKind::kDielectric;
        m.ior = 1.33f;
        b.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, b.add(std::move(m)));
    }
    // Some light that is found easily.
    b.quad({-2, 0.5f, 2.5f}, {4, 0, 0}, {0, 1, 0}, floor, b.emission(Rgb(0.5f)));
    const Vec3 above{0.6f, 3, 0.3f};
    if (lamp == Lamp::kPoint) {
        b.description().point_lights.push_back({above, Rgb(5.0f)});
    } else {
        const float radius = lamp == Lamp::kSmall ? 0.002f : 0.4f;
        b.sphere(above, radius, floor, b.emission(Rgb(1.6f / (radius * radius))));
        if (lamp == Lamp::kHidden) b.hide_sphere();
    }
    b.look({0, 2.5f, -2.5f}, {0, -1, 0}, 45);
    return b.build();
}

struct Moments {
    double mean = 0, square = 0, image = 0;  ///< Luminance per camera sample.
};

Moments rendered(const std::shared_ptr<const Scene>& scene, const std::string& algorithm, uint32_t samples) {
    const RenderSettings settings = testing::settings_of(algorithm, {}, 3);
    const auto renderer = create_with_tables(scene, settings, {});
    EXPECT_TRUE(renderer.ok());
    const RenderUnit work = testing::whole_frame(*scene, settings.algorithm, samples);
    Moments sum;
    const auto seen = [&](const SeenContribution& c) {
        const double value = double(c.found.value.luminance()) * c.weight;
        const double scale =
            c.found.technique.splats()
                ? 1 / double(settings.algorithm.light_paths_per_iteration(scene->frame().crop.area())) * scene->frame().crop.area()
                : 1;
        sum.image += value * scale;
        if (c.found.technique.kind != TechniqueKind::kHit || !testing::by_hits_only(c.view, algorithm == "path")) return;
        sum.mean += value, sum.square += value * value;
    };
    EXPECT_TRUE((*renderer)->watch(work, seen, {}).ok());
    const double count = double(samples) * scene->frame().crop.area();
    return {sum.mean / count, sum.square / count, sum.image / count};
}

RareLight estimate(const Scene& scene, const std::string& algorithm) {
    return estimate_rare_light(scene, testing::settings_of(algorithm, {}, 3));
}

TEST(RareLight, IsWhatHittingALargeLampFinds) {
    const auto scene = pool(Lamp::kLarge);
    for (const std::string algorithm : {"path", "bdpt"}) {
        const Moments truth = rendered(scene, algorithm, 256);
        const RareLight found = estimate(*scene, algorithm);
        ASSERT_TRUE(found.known()) << algorithm;
        EXPECT_NEAR(double(found.by_chance.luminance()) / truth.mean, 1, 0.25) << algorithm;
        // Of one hit, roulette is neglected, which makes fewer of them brighter.
        EXPECT_GT(found.second_moment / truth.square, 0.5) << algorithm;
        EXPECT_LT(found.second_moment / truth.square, 2) << algorithm;
        EXPECT_TRUE(found.unreachable.is_black()) << algorithm;
        const double samples = 256.0 * scene->frame().crop.area();
        const auto report = RareLightReport::of(found, samples, truth.image, 1);
        EXPECT_NEAR(report.share, truth.mean / truth.image, 0.25) << algorithm;
        EXPECT_LT(report.mean_error, RareLightReport::kNotableError) << algorithm;
        EXPECT_GT(report.expected_hits, 100) << algorithm;
    }
}

/// Here the samples alone look like a finished image.
TEST(RareLight, IsKnownBeforeASmallLampWasHit) {
    const auto scene = pool(Lamp::kSmall), large = pool(Lamp::kLarge);
    for (const std::string algorithm : {"path", "bdpt"}) {
        const Moments image = rendered(scene, algorithm, 16);
        EXPECT_EQ(image.mean, 0) << algorithm;
        const double samples = 16.0 * scene->frame().crop.area();
        const auto report = RareLightReport::of(estimate(*scene, algorithm), samples, image.image, 1);
        EXPECT_LT(report.expected_hits, 0.2) << algorithm;
        EXPECT_GT(report.mean_error, 1) << algorithm;
        const Moments truth = rendered(large, algorithm, 64);
        EXPECT_NEAR(report.share, truth.mean / truth.image, 0.2) << algorithm;
    }
}

/// What the film makes of the light changes no share.
TEST(RareLight, DoesNotDependOnTheExposure) {
    const RareLight light{Rgb(0.5f), Rgb(0.25f), 40, 100};
    const auto plain = RareLightReport::of(light, 1e6, 2, 1), bright = RareLightReport::of(light, 1e6, 2 * 8, 8);
    EXPECT_DOUBLE_EQ(plain.share, bright.share);
    EXPECT_DOUBLE_EQ(plain.unreachable_share, bright.unreachable_share);
    EXPECT_DOUBLE_EQ(plain.mean_error, bright.mean_error);
    EXPECT_NEAR(plain.expected_hits, 1e6 * 0.25 / 40, 1);
    EXPECT_EQ(RareLightReport::of({Rgb(1.0f), Rgb(1.0f), 1, 3}, 1e6, 1, 1), RareLightReport{}) << "three pairs are noise";
}

TEST(RareLight, OfLightsThatCannotBeHitIsUnreachable) {
    for (const Lamp lamp : {Lamp::kPoint, Lamp::kHidden}) {
        const auto scene = pool(lamp);
        for (const std::string algorithm : {"path", "bdpt", "spcbpt"}) {
            const RareLight found = estimate(*scene, algorithm);
            EXPECT_NEAR(found.unreachable.luminance(), 0.029f, 0.004f) << algorithm;
            EXPECT_GT(RareLightReport::of(found, 1e6, 1, 1).unreachable_share, RareLightReport::kNotableShare) << algorithm;
        }
    }
}

TEST(RareLight, IsAbsentWithoutGlassAndWhereNoCameraPathsAre) {
    EXPECT_EQ(estimate(*pool(Lamp::kLarge, false), "bdpt"), RareLight{});
    EXPECT_EQ(estimate(*pool(Lamp::kLarge), "light"), RareLight{});
    EXPECT_EQ(estimate(*testing::cornell_builder().build(), "path"), RareLight{});
}

TEST(RareLight, IsTheSameOnAnyNumberOfThreads) {
    const auto scene = pool(Lamp::kLarge);
    const RareLight all = estimate(*scene, "bdpt");
    tbb::task_arena one(1);
    EXPECT_EQ(one.execute([&] { return estimate(*scene, "bdpt"); }), all);
    std::stop_source stop;
    stop.request_stop();
    EXPECT_EQ(estimate_rare_light(*scene, testing::settings_of("bdpt"), stop.get_token()), RareLight{});
}

}  // namespace
}  // namespace lightloom
