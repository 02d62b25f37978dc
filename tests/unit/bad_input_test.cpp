// Scenes that give a method with tables nothing, or too little, to learn from: the right image, finite tables, and a note in the
// report.

#include <gtest/gtest.h>

#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::SceneBuilder;
using Parameters = std::map<std::string, std::string>;

constexpr int kSize = 12, kSeeds = 16, kMaxDepth = 3;

/// Whose mean the others must have: it learns nothing.
const char* const kReference = "path";

/// Few training paths and small caches, whatever the row.
Parameters small(const std::string& algorithm) {
    return testing::with_small_training(
        algorithm,
        testing::those_of(algorithm,
                          {{"training-paths", "400"}, {"cache", "300"}, {"light-subspaces", "50"}, {"eye-subspaces", "50"}}));
}

SceneBuilder empty_builder() {
    SceneBuilder b;
    b.description().film.width = b.description().film.height = kSize;
    b.look({0, 1, -0.95f}, {0, 0.9f, 1}, 80);
    return b;
}

TrainingReport train(const Scene& scene, const Parameters& parameters, Tables* tables = nullptr, int max_depth = kMaxDepth) {
    TrainingReport report;
    const RenderSettings settings = testing::settings_of("spcbpt", parameters, 1, max_depth);
    const auto made = make_tables(scene, settings, {}, &report);
    EXPECT_TRUE(made.ok()) << made.status().message();
    if (made.ok()) {
        EXPECT_TRUE(made->validate(scene.emitters()).ok());
        const std::string bytes = serialize(*made);
        EXPECT_TRUE(parse_tables(bytes, settings.algorithm.info().learning->parts).ok());
        if (tables != nullptr) *tables = *made;
    }
    return report;
}

/// All that learn and find all light have the mean of `path`, in the frame and its blocks.
void expect_means_of_path(const std::shared_ptr<const Scene>& scene, const std::string& what, int max_depth = kMaxDepth,
                          uint32_t samples_per_pixel = 8) {
    testing::TestFamily family;
    const Rect crop = scene->frame().crop;
    const auto path =
        testing::replicate(testing::catalog_image(scene, kReference, max_depth, samples_per_pixel), crop, kSeeds, 100);
    for (const AlgorithmInfo* row : catalog()) {
        if (!row->learning || !testing::complete(*row, "path bdpt")) continue;
        const std::string algorithm(row->name);
        const auto other = testing::replicate(
            testing::catalog_image(scene, algorithm, max_depth, samples_per_pixel, small(algorithm)), crop, kSeeds, 900);
        // Every region, however noisy: the images are checked for what is grossly wrong here, agreement_test measures.
        for (size_t r = 0; r < path.values.size(); ++r) {
            const testing::Sample a(path.values[r]), b(other.values[r]);
            EXPECT_TRUE(std::isfinite(b.mean));
            family.add(testing::welch_p_value(a, b), what + ", " + algorithm + ", region " + std::to_string(r) + ": " +
                                                         std::to_string(a.mean) + " and " + std::to_string(b.mean));
        }
    }
    family.check(0.001);
}

void expect_black(const std::shared_ptr<const Scene>& scene, const std::string& what) {
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        const auto image = testing::catalog_image(scene, algorithm, kMaxDepth, 2, small(algorithm))(1);
        for (const double v : image) EXPECT_EQ(v, 0) << what << ", " << algorithm;
    }
    EXPECT_FALSE(train(*scene, small("spcbpt")).note.empty()) << what;
}

TEST(BadInput, NoLightAtAll) {
    SceneBuilder b = empty_builder();
    b.room({-1, 0, -1}, {1, 2, 1}, b.diffuse(Rgb(0.5f)));
    expect_black(b.build(), "no light");
}

TEST(BadInput, BlackSurfaces) {
    SceneBuilder b = empty_builder();
    b.room({-1, 0, -1}, {1, 2, 1}, b.diffuse(Rgb(0.0f)));
    b.description().point_lights.push_back({{0, 1.5f, 0}, {1, 1, 1}});
    expect_black(b.build(), "black walls and a point light");
}

TEST(BadInput, LightThatReachesNothing) {
    SceneBuilder b = empty_builder();
    b.room({-1, 0, -1}, {1, 2, 1}, b.diffuse(Rgb(0.5f)));
    b.description().point_lights.push_back({{5, 5, 5}, {1, 1, 1}});
    expect_black(b.build(), "a light outside of the room");
    SceneBuilder lamp = empty_builder();
    lamp.room({-1, 0, -1}, {1, 2, 1}, lamp.diffuse(Rgb(0.5f)));
    // Its lit side is against the ceiling from outside.
    lamp.quad({-0.3f, 2.5f, -0.3f}, {0, 0, 0.6f}, {0.6f, 0, 0}, lamp.diffuse(Rgb(0.5f)), lamp.emission({5, 5, 5}));
    expect_black(lamp.build(), "a lamp outside of the room");
}

TEST(BadInput, NothingInView) {
    SceneBuilder b = empty_builder();
    b.quad({-1, -5, -1}, {0, 0, 2}, {2, 0, 0}, b.diffuse(Rgb(0.5f)));
    b.description().point_lights.push_back({{0, -4, 0}, {1, 1, 1}});
    b.look({0, 1, 0}, {0, 5, 1}, 40);
    expect_black(b.build(), "the camera looks away");
}

TEST(BadInput, NoGeometryButASky) {
    SceneBuilder b = empty_builder();
    b.description().infinite_lights.push_back({.radiance = {0.3f, 0.5f, 0.7f}});
    b.sphere({0, 0, -50}, 0.01f, b.diffuse(Rgb(0.5f)));  // behind the camera
    const auto scene = b.build();
    expect_means_of_path(scene, "sky alone");
    EXPECT_FALSE(train(*scene, small("spcbpt")).note.empty());
}

TEST(BadInput, AllSpecularRoom) {
    SceneBuilder b = empty_builder();
    Material mirror;
    mirror.kind = MaterialKind::kConductor;
    mirror.reflectance = b.constant({0.9f, 0.8f, 0.7f});
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    const MaterialId silver = b.add(mirror);
    b.room({-1, 0, -1}, {1, 2, 1}, silver);
    b.sphere({0.3f, 0.5f, 0.3f}, 0.4f, b.add(glass));
    // A lamp of mirror: not even its own surface can be connected to anything.
    b.quad({-0.3f, 1.9f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, silver, b.emission({15, 12, 8}));
    const auto scene = b.build();
    expect_means_of_path(scene, "all specular");
    EXPECT_FALSE(train(*scene, small("spcbpt")).note.empty());
}

TEST(BadInput, SingleLights) {
    const auto with = [](auto add) {
        SceneBuilder b = testing::cornell_builder(kSize);
        b.description().meshes.erase(b.description().meshes.begin() + 6);  // without its lamp
        add(b);
        return b.build();
    };
    expect_means_of_path(with([](SceneBuilder& b) {
                             b.description().point_lights.push_back({{0, 1.5f, 0}, {1, 2, 1}});
                         }),
                         "a point light");
    expect_means_of_path(with([](SceneBuilder& b) {
                             SpotLight spot;
                             spot.position = {0, 1.8f, 0};
                             spot.axes = Frame(Vec3{0, -1, 0});
                             spot.intensity = {5, 4, 3};
                             spot.total_height = 0.2f, spot.falloff_height = 0.1f;
                             b.description().spot_lights.push_back(spot);
                         }),
                         "a spot light");
    expect_means_of_path(with([](SceneBuilder& b) {
                             b.description().meshes.erase(b.description().meshes.begin() + 1);
                             b.description().distant_lights.push_back({normalize(Vec3{0.2f, -1, 0.1f}), {2, 2, 2}});
                         }),
                         "a distant light");
    expect_means_of_path(with([](SceneBuilder& b) {
                             b.description().meshes.erase(b.description().meshes.begin() + 1);
                             b.description().infinite_lights.push_back({.radiance = {1, 2, 3}});
                         }),
                         "a sky");
    expect_means_of_path(with([](SceneBuilder& b) {
                             b.sphere({0, 1.5f, 0}, 0.2f, b.diffuse(Rgb(0.5f)), b.emission({9, 8, 7}));
                         }),
                         "a sphere");
}

/// One light of a thousand times the power of the rest, and one of none.
TEST(BadInput, LightsOfVeryDifferentPower) {
    SceneBuilder b = testing::cornell_builder(kSize);
    for (int i = 0; i < 30; ++i)
        b.description().point_lights.push_back({{-0.9f + 0.06f * float(i), 1.7f, 0.2f}, Rgb(i == 5 ? 3.0f : 0.003f)});
    b.quad({-0.9f, 0.3f, 0.95f}, {0, 0.2f, 0}, {0.2f, 0, 0}, b.diffuse(Rgb(0.5f)), b.emission(Rgb(0.0f)));
    expect_means_of_path(b.build(), "many powers");
}

TEST(BadInput, MoreSubspacesThanTheDataSupport) {
    SceneBuilder b = testing::cornell_builder(kSize);
    const auto scene = b.build();
    testing::TestFamily family;
    // Tables learned from next to nothing make rare bright samples, and the mean of few seeds is not normally distributed.
    constexpr int kMany = 4 * kSeeds;
    const Rect crop = scene->frame().crop;
    const auto expected = testing::replicate(testing::catalog_image(scene, "bdpt", kMaxDepth, 8), crop, kMany, 300);
    const Parameters extremes[] = {
        {{"training-paths", "1"}, {"cache", "1"}},
        {{"training-paths", "20"}, {"cache", "50"}, {"light-subspaces", "16384"}, {"eye-subspaces", "16384"}},
        {{"training-paths", "100"}, {"cache", "50"}, {"light-subspaces", "16384"}, {"source-share", "1"}},
        {{"training-paths", "100"}, {"cache", "50"}, {"light-subspaces", "300"}, {"source-share", "0"}},
        {{"training-paths", "200"}, {"cache", "50"}, {"light-subspaces", "1"}, {"eye-subspaces", "1"}, {"mix", "1"}},
        {{"training-paths", "200"}, {"cache", "50"}, {"trainer", "adam"}, {"mix", "0.001"}},
        {{"training-paths", "200"}, {"cache", "50"}, {"trainer", "contribution"}, {"windows", "32"}, {"reuse-target", "1000"}},
        {{"training-paths", "200"}, {"cache", "50"}, {"direction-weight", "0"}, {"ris-aware", "on"}, {"connections", "16"}},
        {{"training-paths", "200"}, {"cache", "50"}, {"direction-weight", "10"}, {"light-paths", "0.01"}},
    };
    for (const Parameters& parameters : extremes) {
        std::string what;
        for (const auto& [key, value] : parameters) what += key + "=" + value + " ";
        Tables tables;
        const TrainingReport report = train(*scene, parameters, &tables);
        const bool modest = parameters.contains("light-subspaces") && parameters.at("light-subspaces") == "1";
        EXPECT_EQ(report.note.empty(), modest) << what << ": " << report.note;
        const auto image = testing::table_image(scene, testing::settings_of("spcbpt", parameters, 0, kMaxDepth), tables, 8);
        const auto means = testing::replicate(image, crop, kMany, 500);
        family.add(testing::welch_p_value(expected.frame(), means.frame()),
                   what + std::to_string(expected.frame().mean) + " and " + std::to_string(means.frame().mean));
    }
    family.check();
}

TEST(BadInput, ShortestPaths) {
    const auto scene = testing::cornell_builder(kSize).build();
    for (const int max_depth : {0, 1}) {
        expect_means_of_path(scene, "max depth " + std::to_string(max_depth), max_depth);
    }
    EXPECT_FALSE(train(*scene, small("spcbpt"), nullptr, 0).note.empty());
}

/// The labels of the largest tables still fit.
TEST(BadInput, AllSubspacesForASky) {
    SceneBuilder b = testing::cornell_builder(kSize);
    b.description().infinite_lights.push_back({.radiance = Rgb(1000.0f)});
    b.description().meshes.erase(b.description().meshes.begin() + 1);
    train(*b.build(), {{"training-paths", "300"}, {"light-subspaces", "16384"}, {"eye-subspaces", "8"}, {"source-share", "1"}});
}

/// A stop request ends training soon, in every phase.
TEST(BadInput, CancelledTraining) {
    const auto scene = testing::cornell_builder(kSize).build();
    std::stop_source stop;
    stop.request_stop();
    TrainingReport report;
    for (const AlgorithmInfo* row : catalog()) {
        if (!row->learning) continue;
        const std::string name(row->name);
        const auto made = make_tables(*scene, testing::settings_of(name, testing::with_all_learned(name, small(name)), 1, 3),
                                      stop.get_token(), &report);
        ASSERT_FALSE(made.ok()) << name;
        EXPECT_EQ(made.status().code(), StatusCode::kCancelled) << name;
    }
}

}  // namespace
}  // namespace lightloom
