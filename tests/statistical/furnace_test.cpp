// Scenes whose radiance is known in closed form.

#include <gtest/gtest.h>

#include <filesystem>

#include "common/import/import.h"
#include "tests/support/row_techniques.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;
using testing::SceneBuilder;
using testing::TestFamily;

constexpr int kSeeds = 32;

/// Tests the frame and every block against one number.
void expect_constant(const RegionMeans& means, double expected, const std::string& what, TestFamily* family) {
    for (size_t r = 0; r < means.values.size(); ++r) {
        const testing::Sample sample(means.values[r]);
        family->add(testing::one_sample_p_value(sample, expected), what + ", region " + std::to_string(r) + ": " +
                                                                       std::to_string(sample.mean) + " +- " +
                                                                       std::to_string(sample.standard_error()));
    }
}

std::shared_ptr<const Scene> furnace_box(float albedo) {
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 16;
    b.room({-1, -1, -1}, {1, 1, 1}, b.diffuse(Rgb(albedo)), b.emission(Rgb(1.0f)));
    b.look({0, 0, -0.9f}, {0, 0, 1}, 80);
    return b.build();
}

/// A closed box that emits 1 everywhere with albedo a: n edges at most make (1 - a^n) / (1 - a),
/// everywhere. n is max_depth + 1.
TEST(Furnace, BoxTruncatedAtEveryDepth) {
    TestFamily family;
    const double albedo = 0.5;
    const auto scene = furnace_box(float(albedo));
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        double expected = 0, power = 1;
        for (int max_depth = 0; max_depth <= 5; ++max_depth) {
            expected += power;
            power *= albedo;
            const auto image = testing::catalog_image(scene, algorithm, max_depth, 16);
            expect_constant(testing::replicate(image, scene->frame().crop, kSeeds, 100 * uint64_t(max_depth)), expected,
                            algorithm + ", max depth " + std::to_string(max_depth), &family);
        }
    }
    family.check();
}

/// The same for every subset of a row's techniques that contains hits. (Next event and connections alone have no finite variance
/// in the corners of the box, where 1 / d^2 has no bound, and a test of their means would mean nothing.)
TEST(Furnace, BoxWithAnyTechniqueSubset) {
    TestFamily family;
    const auto scene = furnace_box(0.5f);
    const double expected = (0.5 - std::pow(0.5, 5)) / (1 - 0.5);
    for (const AlgorithmInfo* row : catalog()) {
        const testing::RowTechniques has = testing::techniques_of(*row, scene);
        const std::string algorithm(row->name);
        for (int bits = 1; has.hit && bits <= has.bits(); bits += 2) {
            if ((bits & has.bits()) != bits) continue;
            TechniqueMask mask = testing::mask_of_bits(bits);
            mask.min_k = 2;
            const auto image = testing::catalog_image(scene, algorithm, 4, 32, {}, mask);
            expect_constant(testing::replicate(image, scene->frame().crop, kSeeds, 5000 + 100 * uint64_t(bits)), expected,
                            algorithm + ", techniques " + std::to_string(bits), &family);
        }
    }
    family.check();
}

/// A white convex body in a constant environment cannot be told from it.
TEST(Furnace, WhiteSphereInConstantEnvironment) {
    TestFamily family;
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 16;
    b.description().infinite_lights.emplace_back();
    b.sphere({0, 0, 0}, 1, b.diffuse(Rgb(1.0f)));
    b.look({0, 0, -4}, {0, 0, 0}, 40);
    const auto scene = b.build();
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        expect_constant(testing::replicate(testing::catalog_image(scene, algorithm, 3, 32), scene->frame().crop, kSeeds, 7000), 1,
                        algorithm, &family);
    }
    family.check();
}

/// Form factor of two parallel unit squares, facing at distance d [Howell, A Catalog of Radiation
/// Heat Transfer Configuration Factors, C-11].
double facing_squares_form_factor(double d) {
    const double x = 1 / d, x1 = 1 + x * x;
    return 2 / (kPiD * x * x) *
           (std::log(std::sqrt(x1 * x1 / (1 + 2 * x * x))) + 2 * x * std::sqrt(x1) * std::atan(x / std::sqrt(x1)) -
            2 * x * std::atan(x));
}

/// A square lamp facing a white square that fills the frame exactly: its mean radiance is L albedo
/// F. So it is if no ray meets the lamp.
void facing_squares(bool hidden) {
    TestFamily family;
    const float d = 1.5f;
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 16;
    b.quad({-0.5f, -0.5f, 0}, {1, 0, 0}, {0, 1, 0}, b.diffuse(Rgb(0.0f)), b.emission(Rgb(3.0f)));
    if (hidden) b.hide_quad();
    b.quad({-0.5f, -0.5f, d}, {0, 1, 0}, {1, 0, 0}, b.diffuse(Rgb(0.8f)));
    b.look({0, 0, d / 2}, {0, 0, d}, float(2 * std::atan(0.5 / (d / 2)) * 180 / kPiD));
    const auto scene = b.build();
    const double expected = 3 * 0.8 * facing_squares_form_factor(d);
    const auto expect = [&](const testing::ImageOfSeed& image, const std::string& what) {
        const RegionMeans means = testing::replicate(image, scene->frame().crop, kSeeds, 8000);
        EXPECT_LT(means.frame().relative_error(), 0.005) << what;
        family.add(testing::one_sample_p_value(means.frame(), expected), what);
    };
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        expect(testing::catalog_image(scene, algorithm, 1, 128), algorithm);
        for (const Technique t : testing::techniques_of(*row, scene).of_length(2))
            expect(testing::catalog_image(scene, algorithm, 1, 128, {}, testing::mask_of(t, 2)),
                   algorithm + " by " + std::string(to_string(t.kind)) + " " + std::to_string(t.s));
    }
    family.check();
}
TEST(Analytic, FacingSquares) { facing_squares(false); }
TEST(Analytic, FacingSquaresWithAHiddenLamp) { facing_squares(true); }

/// A sphere wholly above the horizon of a plane: irradiance pi L (r / d)^2 cos(theta) at distance d
/// of its centre. If no ray meets it and it shines to both sides, its far side's inner face shines through the near side.
void sphere_over_plane(bool hidden) {
    TestFamily family;
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 16;
    const Vec3 centre{0.3f, 1.0f, 0.2f};
    const double radius = 0.4;
    b.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, b.diffuse(Rgb(0.6f)));
    b.sphere(centre, float(radius), b.diffuse(Rgb(0.0f)), b.emission(Rgb(hidden ? 1.0f : 2.0f), hidden));
    if (hidden) b.hide_sphere();
    b.description().camera.camera_to_world = *inverse(*look_at({0, 0.5f, 0}, {0, 0, 0}, {0, 0, 1}));
    b.description().camera.fov_degrees = 90;  // sees [-0.5, 0.5]^2 of the plane, from below the sphere
    const auto scene = b.build();
    // Mean over the square, by the midpoint rule.
    double expected = 0;
    const int n = 400;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double x = (i + 0.5) / n - 0.5 - centre.x, z = (j + 0.5) / n - 0.5 - centre.z,
                         d2 = x * x + z * z + centre.y * centre.y;
            expected += 0.6 * 2 * radius * radius / d2 * centre.y / std::sqrt(d2) / (n * n);
        }
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        const RegionMeans means =
            testing::replicate(testing::catalog_image(scene, algorithm, 1, hidden ? 256 : 128), scene->frame().crop, kSeeds, 9000);
        EXPECT_LT(means.frame().relative_error(), 0.005) << algorithm;
        family.add(testing::one_sample_p_value(means.frame(), expected), algorithm);
    }
    family.check();
}
TEST(Analytic, SphereOverPlane) { sphere_over_plane(false); }
TEST(Analytic, HiddenSphereOverPlane) { sphere_over_plane(true); }

/// The furnaces of the shared scenes, through the importer and at their own depth of 100 bounces: 1
/// everywhere.
TEST(Furnace, SharedScenes) {
    TestFamily family;
    for (const char* name : {"furnace-box", "furnace-sphere"}) {
        const std::string path = LIGHTLOOM_SOURCE_DIR "/../shared/scenes/" + std::string(name) + "/scene.pbrt";
        if (!std::filesystem::exists(path)) GTEST_SKIP() << "the shared scenes are not beside this source tree";
        Result<ImportedScene> imported = import_pbrt(path);
        ASSERT_TRUE(imported.ok()) << imported.status().message();
        const int max_depth = imported->description.max_depth;
        Result<std::unique_ptr<Scene>> built = Scene::build(std::move(imported->description), {16, 16});
        ASSERT_TRUE(built.ok()) << built.status().message();
        const std::shared_ptr<const Scene> scene = std::move(built).value();
        for (const AlgorithmInfo* row : catalog()) {
            const std::string algorithm(row->name);
            expect_constant(
                testing::replicate(testing::catalog_image(scene, algorithm, max_depth, 16), scene->frame().crop, kSeeds, 100), 1,
                std::string(name) + ", " + algorithm, &family);
        }
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
