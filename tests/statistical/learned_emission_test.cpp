// Scenes in which there is little to learn about emission, or nothing: one point light, a sky alone, lights without extent, a lamp
// whose light never comes out, and no light at all. Learned emission keeps the mean, and a picture that is
// black by right is no error.

#include <gtest/gtest.h>

#include "common/import/import.h"
#include "common/tables/emission_part.h"
#include "common/tables/subspace_tables.h"
#include "tests/support/estimates.h"

namespace lightloom {
namespace {

using testing::RegionMeans;

constexpr int kSeeds = 24, kMaxDepth = 5;
constexpr uint32_t kIterations = 16;

std::shared_ptr<const Scene> scene_of(const std::string& name) {
    auto imported = import_pbrt(LIGHTLOOM_SOURCE_DIR "/tests/scenes/" + name + ".pbrt");
    if (!imported.ok()) throw std::runtime_error(imported.status().message());
    auto built = Scene::build(std::move(imported->description), {24, 24});
    if (!built.ok()) throw std::runtime_error(built.status().message());
    return *std::move(built);
}

RenderSettings settings_of(const std::string& algorithm, const std::string& emission, uint64_t seed) {
    const std::map<std::string, std::string> parameters{{"emission", emission}, {"training-paths", "4000"}};
    return testing::settings_of(algorithm, testing::with_small_training(algorithm, parameters), seed, kMaxDepth);
}

struct Learned {
    Tables tables;
    TrainingReport report;
    bool emission() const { return emission_of(tables) != nullptr; }
};

Learned learn(const Scene& scene, const RenderSettings& settings) {
    Learned out;
    auto tables = make_tables(scene, settings, {}, &out.report);
    if (!tables.ok()) throw std::runtime_error(tables.status().message());
    out.tables = *std::move(tables);
    const Status valid = out.tables.validate(scene.emitters());
    EXPECT_TRUE(valid.ok()) << valid.message();
    return out;
}

/// The rows whose emission can be learned.
std::vector<std::string> algorithms() {
    std::vector<std::string> names;
    for (const AlgorithmInfo* row : catalog())
        if (testing::settings_of(std::string(row->name)).algorithm.has("emission")) names.emplace_back(row->name);
    return names;
}

RegionMeans means(const std::shared_ptr<const Scene>& scene, const testing::ImageOfSeed& image, uint64_t first_seed) {
    return testing::replicate(image, scene->frame().crop, kSeeds, first_seed);
}

TEST(LearnedEmission, KeepsTheMeanWhereThereIsLittleToLearn) {
    testing::TestFamily family;
    for (const std::string name : {"one-point", "env-constant", "delta-lights", "walled-lamp"}) {
        const auto scene = scene_of(name);
        const RegionMeans expected = means(scene, testing::catalog_image(scene, "path", kMaxDepth, 2 * kIterations), 100);
        for (const std::string& algorithm : algorithms()) {
            const std::string what = name + ", " + algorithm;
            const Learned learned = learn(*scene, settings_of(algorithm, "learned", 1));
            EXPECT_TRUE(learned.emission()) << what;
            EXPECT_EQ(learned.report.note.find("no path"), std::string::npos) << what << ": " << learned.report.note;
            EXPECT_EQ(learned.report.out_of_range, 0u) << what;
            const auto image = [&](uint64_t seed) {
                return testing::image_of(
                    Renderer::create(scene, settings_of(algorithm, "learned", seed), learned.tables), *scene,
                    testing::whole_frame(*scene, settings_of(algorithm, "learned", seed).algorithm, kIterations));
            };
            EXPECT_TRUE(testing::compare(expected, means(scene, image, 1000), what, &family)) << what << " is too noisy for a test";
        }
    }
    family.check();
}

/// By power, nine of ten light sub-paths never leave the cube.
TEST(LearnedEmission, LeavesALampAloneWhoseLightNeverComesOut) {
    const auto scene = scene_of("walled-lamp");
    const auto& emitters = scene->emitters().all();
    const auto table = emission_of(learn(*scene, settings_of("bdpt", "learned", 1)).tables);
    ASSERT_NE(table, nullptr);
    for (uint32_t e = 0; e < emitters.size(); ++e) {
        if (emitters[e].kind != EmitterKind::kSphere) continue;
        EXPECT_GT(emitters[e].pmf, 0.8f);
        EXPECT_LT(table->probability(e), 0.02f);
    }
}

/// Nothing to see and nothing to learn from is no error.
TEST(LearnedEmission, FindsNothingInTheDark) {
    const auto scene = scene_of("dark");
    for (const std::string& algorithm : algorithms()) {
        const RenderSettings settings = settings_of(algorithm, "learned", 1);
        const Learned learned = learn(*scene, settings);
        EXPECT_FALSE(learned.emission()) << algorithm;
        if (learned.tables.get<SubspaceTables>()) {
            EXPECT_NE(learned.report.note.find("no path of this scene can be connected"), std::string::npos) << algorithm;
        }
        for (const double v : testing::image_of(Renderer::create(scene, settings, learned.tables), *scene,
                                                testing::whole_frame(*scene, settings.algorithm, 4)))
            EXPECT_EQ(v, 0) << algorithm;
    }
}

}  // namespace
}  // namespace lightloom
