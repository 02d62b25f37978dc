// Film (exposure, sensor, white balance) and the cameras that are no perspective ones.

#include "import_testing.h"

namespace lightloom {
namespace {

/// A scene with this film that must load, and what it warns of.
SceneDescription with_film(const std::string& film, const std::string& camera = "") {
    const Result<ImportedScene> scene = testing::import_text("PixelFilter \"box\"\n" + film + "\n" + camera + "\nWorldBegin");
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return scene.ok() ? scene->description : SceneDescription{};
}

void expect_refused(const std::string& film, const char* part) {
    const Result<ImportedScene> scene = testing::import_text("PixelFilter \"box\"\n" + film + "\nWorldBegin");
    ASSERT_FALSE(scene.ok()) << film;
    EXPECT_NE(scene.status().message().find(part), std::string::npos) << scene.status().message();
    EXPECT_EQ(scene.status().message().rfind("scene.pbrt:2", 0), 0u) << scene.status().message();
}

TEST(ImportFilm, Exposure) {
    const std::string shutter = "Camera \"perspective\" \"float shutteropen\" 1 \"float shutterclose\" 1.5";
    EXPECT_EQ(with_film("Film \"rgb\" \"float iso\" 50").film.response.exposure, 0.5);
    EXPECT_EQ(with_film("Film \"rgb\" \"float iso\" 50", shutter).film.response.exposure, 0.25);
    EXPECT_EQ(with_film("Film \"rgb\" \"float exposuretime\" 4", shutter).film.response.exposure, 4);
    EXPECT_TRUE(with_film("Film \"rgb\" \"float iso\" 50").film.response.is_neutral());
    expect_refused("Film \"rgb\" \"float iso\" 0", "iso");
    expect_refused("Film \"rgb\" \"float exposuretime\" -1", "exposuretime");
    expect_refused("Film \"rgb\" \"integer iso\" 100", "float iso");
}

TEST(ImportFilm, WhiteBalanceTurnsItsLightWhite) {
    // Linear Rec.709 of luminance 1: black bodies below 4000 K, daylight above. Illuminants by their published chromaticity.
    const std::pair<const char*, Rgb> whites[] = {
        {"2856", {1.8451f, 0.8261f, 0.2333f}},  // CIE illuminant A: x 0.44758, y 0.40745
        {"5003", {1.1759f, 0.9757f, 0.7220f}},  // D50: x 0.34567, y 0.35851
        {"6504", {1, 1, 1}},                    // D65
        {"7504", {0.9289f, 1.0065f, 1.1451f}},  // D75: x 0.29903, y 0.31488
    };
    for (const auto& [kelvin, white] : whites) {
        const SceneDescription d = with_film("Film \"rgb\" \"float whitebalance\" " + std::string(kelvin));
        EXPECT_TRUE(d.warnings.empty());
        EXPECT_EQ(d.film.response.exposure, 1);
        const FilmResponse::Triple out = d.film.response.of(white);
        for (const double c : out) EXPECT_NEAR(c, 1, 0.01) << kelvin;
    }
    expect_refused("Film \"rgb\" \"float whitebalance\" 999", "1000");
    expect_refused("Film \"rgb\" \"float whitebalance\" 30000", "25000");
    expect_refused("Film \"rgb\" \"float whitebalance\" -5000", "kelvin");
    EXPECT_TRUE(with_film("Film \"rgb\" \"float whitebalance\" 0").film.response.is_neutral());
}

TEST(ImportFilm, SensorsAreTakenForTheObserver) {
    const SceneDescription plain = with_film("Film \"rgb\" \"string sensor\" \"cie1931\" \"float whitebalance\" 5000");
    EXPECT_TRUE(plain.warnings.empty());
    const SceneDescription canon = with_film("Film \"rgb\" \"string sensor\" \"canon_eos_5d\" \"float whitebalance\" 5000");
    ASSERT_EQ(canon.warnings.size(), 1u);
    EXPECT_NE(canon.warnings[0].find("spectral curves"), std::string::npos);
    EXPECT_EQ(canon.film.response.colour, plain.film.response.colour);
    EXPECT_TRUE(with_film("Film \"rgb\" \"string sensor\" \"sony_ilce_9\"").film.response.is_neutral());
    expect_refused("Film \"rgb\" \"string sensor\" \"canon_eos_6d\"", "canon_eos_6d");
}

TEST(ImportFilm, GeometryChannelsAreNamed) {
    const SceneDescription d =
        with_film("Film \"gbuffer\" \"integer xresolution\" 7 \"string coordinatesystem\" \"world\" \"string filename\" \"a.exr\"");
    ASSERT_EQ(d.warnings.size(), 1u);
    EXPECT_NE(d.warnings[0].find("--layers"), std::string::npos);
    EXPECT_EQ(d.film.width, 7);
    expect_refused("Film \"rgb\" \"string coordinatesystem\" \"world\"", "coordinatesystem");
}

TEST(ImportCamera, Orthographic) {
    const SceneDescription d =
        with_film("Translate 0 0 1", "Camera \"orthographic\" \"float screenwindow\" [-2 2 -1 1] \"float focaldistance\" 3");
    EXPECT_TRUE(d.warnings.empty());
    EXPECT_EQ(d.camera.kind, CameraKind::kOrthographic);
    EXPECT_TRUE(d.camera.has_screen_window);
    EXPECT_EQ(d.camera.screen_window[1], 2);
    EXPECT_EQ(with_film("", "Camera \"orthographic\" \"float frameaspectratio\" 2").camera.frame_aspect_ratio, 2);
    expect_refused("Camera \"orthographic\" \"float lensradius\" 0.1", "lensradius");
    expect_refused("Camera \"orthographic\" \"float fov\" 30", "fov");
    expect_refused("Camera \"orthographic\" \"float screenwindow\" [0 1e-12 0 1]", "narrower");
    expect_refused("Camera \"orthographic\" \"float screenwindow\" [0 1e16 0 1]", "wider");
    expect_refused("Scale 1 2 1 Camera \"orthographic\"", "shears or scales");
}

TEST(ImportCamera, Spherical) {
    EXPECT_EQ(with_film("", "Camera \"spherical\"").camera.kind, CameraKind::kEqualArea);
    EXPECT_EQ(with_film("", "Camera \"spherical\" \"string mapping\" \"equirectangular\"").camera.kind,
              CameraKind::kEquirectangular);
    const SceneDescription d = with_film("", "Camera \"spherical\" \"float screenwindow\" [-1 1 -1 1]");
    ASSERT_EQ(d.warnings.size(), 1u);
    EXPECT_NE(d.warnings[0].find("screenwindow"), std::string::npos);
    expect_refused("Camera \"spherical\" \"string mapping\" \"fisheye\"", "equirectangular");
    expect_refused("Camera \"realistic\"", "perspective");
}

}  // namespace
}  // namespace lightloom
