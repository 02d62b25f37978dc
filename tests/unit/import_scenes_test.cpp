// Every scene of the shared collection, and every own scene in which an algorithm fails, loads with nothing said that would
// change its picture.

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

void loads_without_a_warning(const fs::path& path, size_t least_triangles) {
    const Result<ImportedScene> scene = import_pbrt(path.string());
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    const SceneDescription& d = scene->description;
    for (const std::string& warning : d.warnings) ADD_FAILURE() << warning;
    size_t triangles = 0;
    for (const TriangleMesh& mesh : d.meshes) triangles += mesh.indices.size() / 3;
    EXPECT_GE(triangles + d.spheres.size(), least_triangles);
    EXPECT_FALSE(d.emissions.empty() && d.infinite_lights.empty() && d.point_lights.empty() && d.spot_lights.empty());
    EXPECT_EQ(scene->files.front(), path.filename().string());
    ::testing::Test::RecordProperty("triangles", std::to_string(triangles));
}

class SharedScene : public ::testing::TestWithParam<Expected> {};

TEST_P(SharedScene, LoadsWithoutAWarning) {
    const fs::path path = kScenes / GetParam().path;
    if (!fs::exists(path)) GTEST_SKIP() << "the shared scene " << GetParam().path << " is not on this machine";
    const auto begin = std::chrono::steady_clock::now();
    loads_without_a_warning(path, GetParam().least_triangles);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    RecordProperty("seconds", std::to_string(seconds));
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

TEST(OwnScene, LoadsWithoutAWarning) {
    for (const char* name : {"ceiling-lamp", "corridor", "glossy-lamps", "one-lamp", "paperweight", "pool", "slit"}) {
        SCOPED_TRACE(name);
        loads_without_a_warning(fs::path(LIGHTLOOM_SOURCE_DIR) / "tests/scenes" / (std::string(name) + ".pbrt"), 400);
    }
}

}  // namespace
}  // namespace lightloom
