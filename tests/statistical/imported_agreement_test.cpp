// The scenes of tests/scenes through the importer: all algorithms of the catalog that sample all of
// their paths have the same mean in every region.

#include <gtest/gtest.h>

#include "common/import/import.h"
#include "tests/support/estimates.h"

namespace lightloom {
namespace {

using testing::RegionMeans;

struct File {
    const char* name;
    const char* complete;  ///< The algorithms that sample every path of it.
};

constexpr File kFiles[] = {
    {"ajar-glass", "path bdpt"},
    {"alpha-curtain", "path light bdpt"},
    {"cornell", "path light bdpt"},
    {"delta-lights", "path light bdpt"},
    {"diffuse-transmission", "path light bdpt"},
    {"distant", "path light bdpt"},
    {"env-constant", "path light bdpt"},
    {"env-image", "path light bdpt"},
    {"furnace-box", "path light bdpt"},
    {"furnace-sphere", "path light bdpt"},
    {"image-lights", "path light bdpt"},
    {"instances", "path light bdpt"},
    {"one-point", "path light bdpt"},
    {"panorama", "path light bdpt"},
    {"point-spot", "path light bdpt"},
    {"procedural", "path light bdpt"},
    {"shapes", "path light bdpt"},
    {"smooth-normals", "path light bdpt"},
    {"bumped", "path light bdpt"},
    {"textures", "path light bdpt"},
    {"thin-lens", "path light bdpt"},
    {"two-sided", "path light bdpt"},
    {"walled-lamp", "path light bdpt"},
    {"glossy", "path bdpt"},
    {"coated", "path bdpt"},
    {"glass", "path bdpt"},
};

TEST(ImportedScenes, HaveTheSameMeanInEveryAlgorithm) {
    testing::TestFamily family;
    int tested = 0, pairs = 0;
    for (const File& file : kFiles) {
        Result<ImportedScene> imported = import_pbrt(LIGHTLOOM_SOURCE_DIR "/tests/scenes/" + std::string(file.name) + ".pbrt");
        ASSERT_TRUE(imported.ok()) << imported.status().message();
        Result<std::unique_ptr<Scene>> built = Scene::build(std::move(imported->description), {32, 32});
        ASSERT_TRUE(built.ok()) << built.status().message();
        const std::shared_ptr<const Scene> scene = std::move(built).value();
        const std::vector<std::string> algorithms = testing::algorithms_of(file.complete);
        std::vector<RegionMeans> estimates;
        for (const std::string& name : algorithms)
            estimates.push_back(testing::replicate(testing::catalog_image(scene, name, 5, 16), scene->frame().crop, 32,
                                                   1000 * (estimates.size() + 1)));
        for (size_t a = 0; a < algorithms.size(); ++a)
            for (size_t b = a + 1; b < algorithms.size(); ++b) {
                ++pairs;
                tested += testing::compare(estimates[a], estimates[b],
                                           std::string(file.name) + ", " + algorithms[a] + " and " + algorithms[b], &family);
            }
    }
    EXPECT_GE(tested, pairs * 9 / 10);
    family.check();
}

}  // namespace
}  // namespace lightloom
