// All algorithms of the catalog that find all light, judged 200 times each: no conviction.

#include <gtest/gtest.h>

#include "tests/support/judged_renders.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

TEST(VerdictNightly, NoAlgorithmOfTheCatalogIsConvicted) {
    const auto scene = testing::cornell_builder(12).build();
    const Rect crop = scene->frame().crop;
    const int max_depth = 3;
    const auto reference = testing::reference_render(testing::catalog_slice(scene, "bdpt", max_depth), crop, 64, 256);
    for (const std::string& algorithm : testing::algorithms_of("path light bdpt lvcbpt spcbpt")) {
        const auto all = testing::judge_renders(testing::catalog_slice(scene, algorithm, max_depth), crop, reference, 200, 20, 8);
        EXPECT_EQ(all.biased, 0) << algorithm << ": " << all.last.verdict;
        EXPECT_EQ(all.misses_light, 0) << algorithm << ": " << all.last.verdict;
        RecordProperty(algorithm, all.last.verdict);
        RecordProperty(algorithm + "-sound", all.sound);
    }
}

}  // namespace
}  // namespace lightloom
