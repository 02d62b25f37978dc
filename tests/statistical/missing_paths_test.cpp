// Lights that cannot be hit, mirrors and glass: what an algorithm can sample it gets right, and what it cannot is missing exactly
// as its row of the catalog says (Traces).

#include <gtest/gtest.h>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::RegionMeans;
using testing::SceneBuilder;

constexpr int kSeeds = 32;

RegionMeans estimate(const std::shared_ptr<const Scene>& scene, const std::string& algorithm, uint64_t first_seed,
                     const std::map<std::string, std::string>& parameters = {}) {
    return testing::replicate(testing::catalog_image(scene, algorithm, 5, 32, parameters), scene->frame().crop, kSeeds, first_seed);
}

/// Caustic of a point light, seen directly: whatever traces light sub-paths has it, and agrees about it; what traces from the
/// camera alone lacks it.
TEST(MissingPaths, CausticOfAPointLight) {
    const auto scene = testing::caustic_of_a_point_light();
    const RegionMeans light = estimate(scene, "light", 300);
    testing::TestFamily family;
    uint64_t seed = 700;
    int with = 0, without = 0;
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        const RegionMeans other = estimate(scene, algorithm, seed += 100);
        if (row->traces == Traces::kCamera) {
            const double missing = light.frame().mean - other.frame().mean;
            EXPECT_GT(missing, 6 * std::sqrt(light.frame().variance + other.frame().variance)) << algorithm;
            ++without;
        } else if (row->shares_light_paths) {
            // A cache is shared by all pixels, so that means over blocks are far from normal.
            family.add(testing::welch_p_value(light.frame(), other.frame()), "light and " + algorithm);
            ++with;
        } else {
            EXPECT_TRUE(testing::compare(light, other, "light and " + algorithm, &family));
            ++with;
        }
    }
    EXPECT_GE(with, 4);
    EXPECT_GE(without, 2);
    family.check();
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
    for (const AlgorithmInfo* row : catalog()) {
        const double mean = estimate(with_point, std::string(row->name), 300).frame().mean;
        if (row->merges)
            EXPECT_GT(mean, 0) << row->name << " should see this point light";
        else
            EXPECT_EQ(mean, 0) << row->name << " should not be able to see this point light";
        // The same energy as vcm finds, which is the only other one that finds any.
        if (row->may_merge) {
            const testing::Sample vcm = estimate(with_point, "vcm", 400, {{"merge-radius", "1"}}).frame();
            const testing::Sample merged =
                estimate(with_point, std::string(row->name), 500, {{"merging", "on"}, {"merge-radius", "1"}}).frame();
            EXPECT_GT(merged.mean, 0);
            EXPECT_NEAR(merged.mean, vcm.mean, 4 * std::sqrt(merged.variance + vcm.variance) + 0.02 * vcm.mean) << row->name;
        }
    }
    // The lamp can be hit: everything with hits sees it, and agrees; light tracing still does not.
    const RegionMeans path = estimate(with_lamp, "path", 300);
    EXPECT_GT(path.frame().mean, 0);
    testing::TestFamily family;
    uint64_t seed = 700;
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        const testing::Sample frame = estimate(with_lamp, algorithm, seed += 100).frame();
        if (row->traces == Traces::kLight)
            EXPECT_EQ(frame.mean, 0) << algorithm;
        else
            family.add(testing::welch_p_value(path.frame(), frame), "path and " + algorithm);
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
