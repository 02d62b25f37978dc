// Every scene of the shared collection loads, with nothing said that would change its picture.

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "common/import/import.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

const fs::path kScenes = fs::path(LIGHTLOOM_SOURCE_DIR) / ".." / "shared" / "scenes";

struct Expected {
    const char* path;
    size_t least_triangles;
};

class SharedScene : public ::testing::TestWithParam<Expected> {};

TEST_P(SharedScene, LoadsWithoutAWarning) {
    const fs::path path = kScenes / GetParam().path;
    if (!fs::exists(path)) GTEST_SKIP() << "the shared scene " << GetParam().path << " is not on this machine";
    const auto begin = std::chrono::steady_clock::now();
    const Result<ImportedScene> scene = import_pbrt(path.string());
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    const SceneDescription& d = scene->description;
    for (const std::string& warning : d.warnings) ADD_FAILURE() << warning;
    size_t triangles = 0;
    for (const TriangleMesh& mesh : d.meshes) triangles += mesh.indices.size() / 3;
    EXPECT_GE(triangles + d.spheres.size(), GetParam().least_triangles);
    EXPECT_FALSE(d.emissions.empty() && d.infinite_lights.empty() && d.point_lights.empty());
    EXPECT_EQ(scene->files.front(), path.filename().string());
    RecordProperty("seconds", std::to_string(seconds));
    RecordProperty("triangles", std::to_string(triangles));
}

INSTANTIATE_TEST_SUITE_P(All, SharedScene,
                         ::testing::Values(Expected{"bedroom/scene.pbrt", 270000}, Expected{"box-far-ceiling/scene.pbrt", 10},
                                           Expected{"box-near-ceiling/scene.pbrt", 10}, Expected{"classroom/scene.pbrt", 100000},
                                           Expected{"cornell-box/scene.pbrt", 30}, Expected{"cornell-closed/scene.pbrt", 10},
                                           Expected{"cornell-peer/scene.pbrt", 30}, Expected{"curtain-slit/scene.pbrt", 10},
                                           Expected{"door/scene.pbrt", 20000}, Expected{"door/scene-facing.pbrt", 20000},
                                           Expected{"door-many-lights/scene.pbrt", 10}, Expected{"furnace-box/scene.pbrt", 1},
                                           Expected{"furnace-sphere/scene.pbrt", 1}, Expected{"glossy-highlights/scene.pbrt", 5},
                                           Expected{"house/scene.pbrt", 470000}, Expected{"lampshade-mirror/scene.pbrt", 10},
                                           Expected{"modern-hall/scene.pbrt", 28000},
                                           Expected{"sds-glass-sphere-mirror/scene.pbrt", 5}, Expected{"sponza/scene.pbrt", 65000},
                                           Expected{"striped-caustics/scene.pbrt", 5}, Expected{"torus/scene.pbrt", 23000},
                                           Expected{"veach-ajar/scene.pbrt", 23000}, Expected{"veach-bidir/scene.pbrt", 11000}),
                         [](const auto& test) {
                             std::string name = test.param.path;
                             for (char& c : name)
                                 if (!isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name;
                         });

}  // namespace
}  // namespace lightloom
