// Scenes that single precision would lose: far from the origin, or of very weak or strong light.

#include <cmath>

#include "tests/unit/import_testing.h"

namespace lightloom {
namespace {

using testing::import_text;

/// A room around a place, put there by every directive that can.
std::string room(const std::string& x, const std::string& z, double eye_x, double eye_z) {
    const std::string at = x + " 0 " + z, matrix = "[1 0 0 0  0 1 0 0  0 0 1 0  " + at + " 1]";
    return "PixelFilter \"box\"\nLookAt " + std::to_string(eye_x) + " 2 " + std::to_string(eye_z) + " " + at +
           " 0 1 0\nCamera \"perspective\"\nWorldBegin\n"
           "CoordSysTransform \"camera\"\nLightSource \"point\" \"point3 from\" [1 2 3]\n"
           "CoordSysTransform \"world\"\nTranslate " +
           at +
           "\nCoordinateSystem \"room\"\n"
           "Shape \"sphere\" \"float radius\" 0.5\n"
           "Identity\nTransform " +
           matrix +
           "\nShape \"trianglemesh\" \"point3 P\" [0.1 0 0  1 0 0  0 1 0.3] \"integer indices\" [0 1 2]\n"
           "Identity\nConcatTransform " +
           matrix +
           "\nLightSource \"spot\" \"point3 from\" [0 2 0] \"point3 to\" [0 0 0]\n"
           "Identity\nObjectBegin \"o\"\nTranslate 0.25 0 0\nShape \"sphere\" \"float radius\" 0.125\nObjectEnd\n"
           "CoordSysTransform \"room\"\nObjectInstance \"o\"\n";
}

TEST(ImportRange, AFarSceneIsMovedToItsCamera) {
    const auto near = import_text(room("0", "0", 0, -5)), far = import_text(room("100000", "-300000", 100000, -300005));
    ASSERT_TRUE(near.ok()) << near.status().message();
    ASSERT_TRUE(far.ok()) << far.status().message();
    const SceneDescription &a = near->description, &b = far->description;
    EXPECT_EQ(a.origin, (std::array<double, 3>{0, 0, 0}));
    EXPECT_EQ(b.origin, (std::array<double, 3>{100000, 0, -300005}));
    const Vec3 moved{0, 0, 5};  // the near camera's place in the moved scene is the origin
    const auto same = [&](const Vec3& p, const Vec3& q) { EXPECT_LT(length(p + moved - q), 2e-6f); };
    ASSERT_EQ(b.spheres.size(), 1u);
    same(a.spheres[0].centre, b.spheres[0].centre);
    ASSERT_EQ(b.meshes.size(), 1u);
    for (size_t i = 0; i < 3; ++i) same(a.meshes[0].positions[i], b.meshes[0].positions[i]);
    same(a.point_lights[0].position, b.point_lights[0].position);
    same(a.spot_lights[0].position, b.spot_lights[0].position);
    EXPECT_EQ(a.objects[0].spheres[0].centre, b.objects[0].spheres[0].centre);
    same(a.instances[0].object_to_world.point({1, 2, 3}), b.instances[0].object_to_world.point({1, 2, 3}));
    same(a.camera.camera_to_world.point({0, 0, 0}), b.camera.camera_to_world.point({0, 0, 0}));
}

TEST(ImportRange, ASceneNearTheOriginStaysWhereItIs) {
    const auto scene = import_text(room("1000", "-2000", 1000, -2005));
    ASSERT_TRUE(scene.ok());
    EXPECT_EQ(scene->description.origin, (std::array<double, 3>{0, 0, 0}));
    EXPECT_EQ(scene->description.spheres[0].centre, (Vec3{1000, 0, -2000}));
}

TEST(ImportRange, WeakAndStrongLightIsBroughtToOneAndTheExposureTakesItBack) {
    const auto with = [](const std::string& strength) {
        return testing::world("LightSource \"point\" \"rgb I\" [" + strength + " " + strength + " 0]\n" +
                              "LightSource \"distant\" \"rgb L\" [" + strength + " 0 0]\nShape \"sphere\"\n");
    };
    const SceneDescription one = with("1");
    EXPECT_EQ(one.strength_scale, 1);
    for (const char* strength : {"1e-12", "3e-30", "7e-6", "2e15", "1e30"}) {
        const SceneDescription scene = with(strength);
        const double expected = std::strtod(strength, nullptr) / double(one.point_lights[0].intensity.g);
        EXPECT_GE(scene.point_lights[0].intensity.r, 1) << strength;
        EXPECT_LT(scene.point_lights[0].intensity.r, 2) << strength;
        for (const Rgb& c : {scene.point_lights[0].intensity, scene.distant_lights[0].irradiance})
            EXPECT_NEAR(double(c.r) * scene.film.response.exposure / expected, 1, 1e-6) << strength;
        EXPECT_EQ(scene.strength_scale * scene.film.response.exposure, 1) << strength;
    }
    for (const char* strength : {"1e-4", "1e9"}) EXPECT_EQ(with(strength).strength_scale, 1) << strength;
}

}  // namespace
}  // namespace lightloom
