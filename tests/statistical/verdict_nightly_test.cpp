// All algorithms of the catalog that find all light, judged 200 times each: no more convictions than the level allows.

#include <gtest/gtest.h>

#include "tests/support/judged_renders.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

TEST(VerdictNightly, SoundAlgorithmsAreConvictedNoMoreOftenThanTheLevelSays) {
    const auto scene = testing::cornell_builder(12).build();
    const Rect crop = scene->frame().crop;
    const int max_depth = 3;
    const auto reference = testing::reference_render(testing::catalog_slice(scene, "bdpt", max_depth), crop, 64, 256);
    int judgements = 0, convictions = 0;
    for (const std::string& algorithm : testing::algorithms_of("path light bdpt lvcbpt spcbpt")) {
        const auto all = testing::judge_renders(testing::catalog_slice(scene, algorithm, max_depth), crop, reference, 200, 20, 8);
        judgements += 200;
        convictions += all.biased + all.misses_light;
        if (all.biased + all.misses_light > 0) RecordProperty(algorithm + "-convicted", all.biased + all.misses_light);
        RecordProperty(algorithm, all.last.verdict);
        RecordProperty(algorithm + "-sound", all.sound);
    }
    // Of 1200 judgements at the level of 0.1 %, more than 6 are convictions with a probability of 0.03 %.
    EXPECT_EQ(judgements, 1200);
    EXPECT_LE(convictions, 6);
}

}  // namespace
}  // namespace lightloom
