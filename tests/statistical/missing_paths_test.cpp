// Lights that cannot be hit, mirrors and glass: what an algorithm can sample it gets right, and
// what it cannot is missing exactly as its description in the catalog says.

#include <gtest/gtest.h>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;
using testing::SceneBuilder;

constexpr int kSeeds = 32;

RegionMeans estimate(const std::shared_ptr<const Scene>& scene, const std::string& algorithm) {
    return testing::replicate(testing::catalog_image(scene, algorithm, 5, 32), scene->frame().crop, kSeeds, 300);
}

/// Caustic of a point light, seen directly: light tracing and bdpt agree, the unidirectional path
/// tracer lacks it.
TEST(MissingPaths, CausticOfAPointLight) {
    const auto scene = testing::caustic_of_a_point_light();
    const RegionMeans path = estimate(scene, "path"), light = estimate(scene, "light");
    const RegionMeans bdpt = testing::replicate(testing::catalog_image(scene, "bdpt", 5, 32), scene->frame().crop, kSeeds, 700);
    testing::TestFamily family;
    EXPECT_TRUE(testing::compare(light, bdpt, "light and bdpt", &family));
    for (const char* algorithm : {"lvcbpt", "spcbpt"})
        family.add(testing::welch_p_value(light.frame(), estimate(scene, algorithm).frame()), algorithm);
    family.check();
    const double missing = light.frame().mean - path.frame().mean;
    EXPECT_GT(missing, 6 * std::sqrt(light.frame().variance + path.frame().variance));
}

/// A lamp and a lit wall that the camera sees in a mirror only, while the lamp shines onto the wall
/// through a pane of glass only: every path of five edges or fewer is specular - diffuse -
/// specular.
std::shared_ptr<const Scene> behind_glass_in_a_mirror(bool point) {
    SceneBuilder b;
    Material mirror, glass;
    mirror.kind = MaterialKind::kConductor;
    mirror.reflectance = b.constant(Rgb(0.9f));
    glass.kind = MaterialKind::kThinDielectric;
    const MaterialId silver = b.add(mirror), pane = b.add(glass), white = b.diffuse(Rgb(0.7f)), black = b.diffuse(Rgb(0.0f));
    b.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, white);         // the floor
    b.quad({-2, 0, 2}, {0, 3, 0}, {4, 0, 0}, silver);         // the mirror that the camera looks into
    b.room({-0.5f, 1.5f, -0.5f}, {0.5f, 2.5f, 0.5f}, black);  // a lantern, its floor taken out ...
    b.description().meshes.erase(b.description().meshes.begin() + 2);
    b.quad({-0.5f, 1.5f, -0.5f}, {0, 0, 1}, {1, 0, 0}, pane);  // ... for glass
    if (point)
        b.description().point_lights.push_back({{0, 2, 0}, {3, 3, 3}});
    else
        b.sphere({0, 2, 0}, 0.2f, black, b.emission(Rgb(30.0f)));
    b.look({0, 0.8f, -1}, {0, 0.5f, 2}, 10);
    return b.build();
}

TEST(MissingPaths, SpecularDiffuseSpecular) {
    const auto with_point = behind_glass_in_a_mirror(true), with_lamp = behind_glass_in_a_mirror(false);
    for (const char* algorithm : {"path", "light", "bdpt", "lvcbpt", "spcbpt"})
        EXPECT_EQ(estimate(with_point, algorithm).frame().mean, 0) << algorithm << " should not be able to see this point light";
    // The lamp can be hit: both algorithms with hits see it, and agree; light tracing still does
    // not.
    EXPECT_EQ(estimate(with_lamp, "light").frame().mean, 0);
    const RegionMeans path = estimate(with_lamp, "path");
    const RegionMeans bdpt =
        testing::replicate(testing::catalog_image(with_lamp, "bdpt", 5, 32), with_lamp->frame().crop, kSeeds, 700);
    EXPECT_GT(path.frame().mean, 0);
    testing::TestFamily family;
    family.add(testing::welch_p_value(path.frame(), bdpt.frame()), "path and bdpt");
    for (const char* algorithm : {"lvcbpt", "spcbpt"})
        family.add(testing::welch_p_value(path.frame(), estimate(with_lamp, algorithm).frame()), algorithm);
    family.check();
}

}  // namespace
}  // namespace lightloom
