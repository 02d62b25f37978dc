// Lights whose strength images give.

#include <cmath>

#include "import_looks.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::FileMap;
using testing::tga;
using testing::world;

/// Of two pixels, white and black, side by side; and of one.
const FileMap kFiles{{"a.tga", tga(2, 1, std::string("\xff\xff\xff", 3) + std::string(3, '\0'))},
                     {"white.tga", tga(1, 1, std::string("\xff\xff\xff", 3))},
                     {"black.tga", tga(1, 1, std::string(3, '\0'))}};

TEST(ImportLight, Projection) {
    const std::string light = "LightSource \"projection\" \"string filename\" \"a.tga\" ";
    const SceneDescription d = world("Translate 1 2 3 " + light + "\"float fov\" 60 \"float scale\" 3", kFiles);
    ASSERT_EQ(d.image_lights.size(), 1u);
    const ImageLight& l = d.image_lights[0];
    EXPECT_EQ(l.kind, ImageLight::Kind::kProjection);
    EXPECT_EQ(l.position, Vec3(1, 2, 3));
    EXPECT_NEAR(l.half_height, std::tan(3.14159265 / 6), 1e-5) << "fov is the shorter side's";
    EXPECT_NEAR(l.half_width, 2 * std::tan(3.14159265 / 6), 1e-5);
    EXPECT_EQ(l.intensity, Rgb(3.0f));
    EXPECT_EQ(l.source, "scene.pbrt:3");
    // Half of the picture is white.
    const double solid_angle = 2 * std::atan(2 / std::sqrt(1.0 + 1 + 4));
    EXPECT_NEAR(world(light + "\"float power\" 10", kFiles).image_lights.at(0).intensity.g, 10 / solid_angle, 1e-4);
    expect_error("\nLightSource \"projection\"", {"scene.pbrt:4", "filename"});
    expect_error(light, {"a.tga"});
    expect_error(light + "\"float fov\" 180", {"fov"}, kFiles);
    expect_error(light + "\"rgb I\" [1 1 1]", {"rgb I"}, kFiles);
    expect_error("Scale 1 2 1 " + light, {"transformation"}, kFiles);
    expect_error("LightSource \"projection\" \"string filename\" \"black.tga\" \"float power\" 1", {"black"}, kFiles);
    EXPECT_TRUE(world("LightSource \"projection\" \"string filename\" \"black.tga\"", kFiles).image_lights.empty());
}

TEST(ImportLight, Goniometric) {
    const std::string light = "LightSource \"goniometric\" \"string filename\" \"white.tga\" ";
    const SceneDescription d = world(light + "\"rgb I\" [1 2 3] \"float scale\" 2", kFiles);
    ASSERT_EQ(d.image_lights.size(), 1u);
    EXPECT_EQ(d.image_lights[0].kind, ImageLight::Kind::kGoniometric);
    EXPECT_EQ(d.image_lights[0].intensity, Rgb(2, 4, 6));
    EXPECT_NEAR(world(light + "\"float power\" 10", kFiles).image_lights.at(0).intensity.g, 10 / (4 * 3.14159265), 1e-5);
    expect_error("\nLightSource \"goniometric\"", {"scene.pbrt:4", "filename"});
    expect_error("LightSource \"goniometric\" \"string filename\" \"a.tga\"", {"square", "2 x 1", "makeequiarea"}, kFiles);
    expect_error(light + "\"rgb I\" [-1 0 0]", {"negative"}, kFiles);
    expect_error("LightSource \"laser\"", {"projection", "goniometric"});
}

}  // namespace
}  // namespace lightloom
