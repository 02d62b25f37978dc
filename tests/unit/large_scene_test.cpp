// Byte identity on a scene of real size: house, with a tenth of its triangles doubled in place under another material, so that
// the closest hit is a tie in many rays, and the acceleration structure built with 1, 2 and 8 threads allowed.

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cstring>
#include <filesystem>

#include "common/import/import.h"
#include "tests/support/estimates.h"

namespace lightloom {
namespace {

void double_triangles(SceneDescription* scene) {
    Material other;
    other.name = "double";
    scene->materials.push_back(other);
    const size_t meshes = scene->meshes.size();
    for (size_t m = 0; m < meshes; ++m) {
        TriangleMesh copy = scene->meshes[m];
        copy.attributes.material = MaterialId(scene->materials.size()) - 1;
        copy.attributes.emission = kNone;
        std::vector<uint32_t> some;
        for (size_t t = 0; t + 2 < copy.indices.size(); t += 30)
            some.insert(some.end(), copy.indices.begin() + ptrdiff_t(t), copy.indices.begin() + ptrdiff_t(t) + 3);
        copy.indices = std::move(some);
        scene->meshes.push_back(std::move(copy));
    }
}

TEST(LargeScene, CoplanarDuplicatesRenderTheSameBytesHoweverTheStructureWasBuilt) {
    const std::string path = std::string(LIGHTLOOM_SOURCE_DIR) + "/../shared/scenes/house/scene.pbrt";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "the shared scenes are not here";
    auto imported = import_pbrt(path);
    ASSERT_TRUE(imported.ok()) << imported.status().message();
    double_triangles(&imported->description);

    const tbb::global_control allowance(tbb::global_control::max_allowed_parallelism, 8);
    Partial first;
    for (const int threads : {1, 2, 8}) {
        tbb::task_arena(threads).execute([&] {
            auto scene = Scene::build(imported->description, {.width = 96, .height = 54});
            ASSERT_TRUE(scene.ok()) << scene.status().message();
            const RenderSettings settings = testing::settings_of("bdpt", {}, 3, 8);
            const RenderUnit unit = testing::whole_frame(**scene, settings.algorithm, 4);
            const auto renderer = Renderer::create(std::move(scene).value(), settings);
            ASSERT_TRUE(renderer.ok());
            auto partial = (*renderer)->render(unit, {});
            ASSERT_TRUE(partial.ok());
            if (threads == 1) {
                first = std::move(partial).value();
                return;
            }
            ASSERT_EQ(first.camera.size(), partial->camera.size());
            EXPECT_EQ(std::memcmp(first.camera.data(), partial->camera.data(), first.camera.size() * sizeof(double)), 0);
            EXPECT_EQ(first.splats, partial->splats);
            EXPECT_EQ(first.counters.rays, partial->counters.rays);
        });
    }
}

}  // namespace
}  // namespace lightloom
