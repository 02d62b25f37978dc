#include <gtest/gtest.h>

#include "common/import/importer.h"

namespace lightloom {
namespace {

TEST(Import, SmallestScene) {
    import::MemorySource files(std::map<std::string, std::string>{{"scene.pbrt", "Camera \"perspective\" WorldBegin Shape \"sphere\""}});
    const auto scene = import::import_from(&files, "scene.pbrt", {});
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->description.spheres.size(), 1u);
}

}  // namespace
}  // namespace lightloom
