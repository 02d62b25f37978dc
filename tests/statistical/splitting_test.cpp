// Several samples where there was one leave every mean as it is: shadow rays, and light sub-paths that a camera vertex is connected
// to.

#include <gtest/gtest.h>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

constexpr int kSeeds = 16;

/// Mutations: n left out of sigma, or of the sample's share, fail this.
TEST(Splitting, KeepsTheMean) {
    testing::TestFamily family;
    int tested = 0;
    struct Place {
        const char* name;
        std::shared_ptr<const Scene> (*make)();
    };
    for (const auto& [name, make] :
         {Place{"spherical_lights", testing::spherical_lights}, Place{"environment_lit", testing::environment_lit}}) {
        const auto scene = make();
        uint64_t seed = 1000;
        const auto means = [&](const AlgorithmInfo& row, const std::map<std::string, std::string>& parameters) {
            return testing::replicate(testing::catalog_image(scene, std::string(row.name), 3, 8, parameters), scene->frame().crop,
                                      kSeeds, seed += 100);
        };
        for (const AlgorithmInfo* row : catalog()) {
            if (!testing::settings_of(std::string(row->name)).algorithm.has("shadow-rays")) continue;
            const testing::RegionMeans one = means(*row, {});
            const auto compare = [&](const std::map<std::string, std::string>& parameters, const std::string& what) {
                tested += testing::compare(one, means(*row, parameters),
                                           std::string(name) + ", " + std::string(row->name) + " with " + what, &family);
            };
            compare({{"shadow-rays", "4"}}, "4 shadow rays");
            if (row->name == "vcm") compare({{"connections", "5,3"}}, "connections=5,3");
        }
    }
    EXPECT_GE(tested, 10);
    family.check();
}

}  // namespace
}  // namespace lightloom
