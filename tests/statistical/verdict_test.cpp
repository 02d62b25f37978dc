// The judge of stability on renderings: an algorithm that counts its light wrongly is convicted, one that is right never is.

#include <gtest/gtest.h>

#include "common/film/rare_light.h"
#include "common/transport/bdpt.h"
#include "common/transport/path.h"
#include "tests/support/judged_renders.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

constexpr int kSeeds = 20;

/// An algorithm of which each technique counts by a factor that should be 1.
template <class A>
struct Miscounted : A {
    std::function<float(Technique)> factor;
    float weight(const PathView& view, Technique own) const { return factor(own) * A::weight(view, own); }
};

template <class A>
void expect_no_conviction(const std::shared_ptr<const Scene>& scene, const A& algorithm, int max_depth, const std::string& name) {
    const Rect crop = scene->frame().crop;
    const auto slice = testing::algorithm_slice(scene, algorithm, max_depth);
    const auto reference = testing::reference_render(slice, crop, 32, 128);
    const auto all = testing::judge_renders(slice, crop, reference, 200, kSeeds, 8);
    EXPECT_EQ(all.judged, 200) << name << ": " << all.last.verdict;
    EXPECT_EQ(all.biased, 0) << name << ": " << all.last.verdict;
    EXPECT_EQ(all.misses_light, 0) << name << ": " << all.last.verdict;
    EXPECT_EQ(all.stalls, 0) << name << ": " << all.last.verdict;
    ::testing::Test::RecordProperty(name, all.last.verdict);
    ::testing::Test::RecordProperty(name + "-sound", all.sound);
}

TEST(Verdict, AnUnbiasedAlgorithmIsNeverConvicted) {
    const auto scene = testing::cornell_builder(9).build();
    expect_no_conviction(scene, PathAlgorithm<PathSelection>{}, 2, "path");
    expect_no_conviction(scene, BdptAlgorithm<BdptSelection>{testing::bdpt_selection(*scene)}, 2, "bdpt");
}

TEST(Verdict, AlgorithmsThatCountWronglyAreConvicted) {
    const auto scene = testing::cornell_builder(9).build();
    const Rect crop = scene->frame().crop;
    const PathAlgorithm<PathSelection> path;
    const BdptAlgorithm<BdptSelection> bdpt{testing::bdpt_selection(*scene)};
    const auto reference = testing::reference_render(testing::algorithm_slice(scene, path, 2), crop, 32, 128);
    const auto factor = [](float f) { return [f](Technique) { return f; }; };
    const auto without = [](TechniqueKind kind) { return [kind](Technique t) { return t.kind == kind ? 0.0f : 1.0f; }; };
    int number = 0;
    const auto judge = [&](const auto& algorithm, const char* words) {
        const auto all = testing::judge_renders(testing::algorithm_slice(scene, algorithm, 2), crop, reference, 2, kSeeds, 64);
        EXPECT_EQ(all.biased, 2) << words << ": " << all.last.verdict;
        EXPECT_NE(all.last.verdict.find(words), std::string::npos) << all.last.verdict;
        ::testing::Test::RecordProperty("verdict-" + std::to_string(++number), all.last.verdict);
    };
    judge(Miscounted<PathAlgorithm<PathSelection>>{path, factor(0.97f)}, "% too dark in ");
    judge(Miscounted<PathAlgorithm<PathSelection>>{path, factor(1.03f)}, "% too bright in ");
    judge(Miscounted<PathAlgorithm<PathSelection>>{path, without(TechniqueKind::kNextEvent)}, "% too dark in ");
    judge(Miscounted<BdptAlgorithm<BdptSelection>>{bdpt, without(TechniqueKind::kLens)}, "% too dark in ");
    judge(Miscounted<BdptAlgorithm<BdptSelection>>{bdpt, without(TechniqueKind::kConnect)}, "% too dark in ");
}

/// `path` never finds the caustic of a point light: bias, unless the estimate of rare light has announced it.
TEST(Verdict, LightThatIsAnnouncedAsUnreachableIsMissedNotBiased) {
    const auto scene = testing::caustic_of_a_point_light();
    const Rect crop = scene->frame().crop;
    const int max_depth = 5;
    const auto reference = testing::reference_render(testing::catalog_slice(scene, "light", max_depth), crop, 16, 64);
    const auto slice = testing::catalog_slice(scene, "path", max_depth);
    const auto unexplained = testing::judge_renders(slice, crop, reference, 1, kSeeds, 4);
    EXPECT_TRUE(unexplained.last.biased) << unexplained.last.verdict;

    const auto renderer = Renderer::create(scene, testing::settings_of("path", {}, 1, max_depth));
    ASSERT_TRUE(renderer.ok());
    const auto report = RareLightReport::of((*renderer)->rare_light({}), 4.0 * double(crop.area()),
                                            luminance_means(reference.image, 1, 1)[0] * unexplained.last.regions[0].ratio, 1);
    const ChanceLight chance{report.share, report.unreachable_share, report.expected_hits};
    const auto explained = testing::judge_renders(slice, crop, reference, 1, kSeeds, 4, chance);
    EXPECT_FALSE(explained.last.biased) << explained.last.verdict;
    EXPECT_TRUE(explained.last.misses_light) << explained.last.verdict;
    EXPECT_NE(explained.last.verdict.find("of the light is never found"), std::string::npos) << explained.last.verdict;
    RecordProperty("unexplained", unexplained.last.verdict);
    RecordProperty("explained", explained.last.verdict);
}

}  // namespace
}  // namespace lightloom
