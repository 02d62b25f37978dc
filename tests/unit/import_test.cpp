// Directives, graphics state, parameters, camera and film.

#include "common/film/partial_exr.h"
#include "common/import/context.h"
#include "common/import/spectra.h"
#include "common/path/path_view.h"
#include "import_testing.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::import_text;
using testing::import_world;
using testing::world;

const char kTriangle[] = "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";

Vec3 first_corner(const SceneDescription& d, size_t mesh = 0) { return d.meshes.at(mesh).positions.at(0); }

void expect_near(const Vec3& a, const Vec3& b, float tolerance = 1e-5f) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(ImportTransform, ComposesInPbrtOrder) {
    const std::string mesh = "Shape \"trianglemesh\" \"point3 P\" [1 0 0 0 1 0 0 0 1]";
    expect_near(first_corner(world("Translate 1 2 3 Scale 2 2 2 " + mesh)), {3, 2, 3});
    expect_near(first_corner(world("Rotate 90 0 0 1 " + mesh)), {0, 1, 0});
    expect_near(first_corner(world("Translate 9 9 9 Identity " + mesh)), {1, 0, 0});
    // Matrices are written column by column.
    expect_near(first_corner(world("Translate 9 9 9 Transform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1] " + mesh)), {6, 6, 7});
    expect_near(first_corner(world("Scale 2 1 1 ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1] " + mesh)), {12, 6, 7});
    expect_near(first_corner(world("Translate 1 0 0 CoordinateSystem \"a\" Identity CoordSysTransform \"a\" " + mesh)), {2, 0, 0});
    // LookAt is world to camera: the eye lands at the origin.
    expect_near(first_corner(world("LookAt 1 0 0  1 0 5  0 1 0 " + mesh)), {0, 0, 0});
    expect_near(first_corner(world("AttributeBegin Translate 5 0 0 AttributeEnd TransformBegin Scale 7 7 7 TransformEnd " + mesh)),
                {1, 0, 0});
    expect_near(first_corner(world("ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 1 0 0 "
                                   "ActiveTransform All TransformTimes 0 1 " +
                                   mesh)),
                {2, 0, 0});
}

TEST(ImportTransform, Errors) {
    expect_error("Translate 1 2 x", {"Translate", "\"x\""});
    expect_error("Translate 1 2 nan", {"Translate"});
    expect_error(std::string("Rotate 10 0 0 0 ") + kTriangle, {"axis"});
    expect_error(std::string("LookAt 0 0 0 0 0 0 0 1 0 ") + kTriangle, {"LookAt"});
    expect_error(std::string("LookAt 0 0 0 0 1 0 0 1 0 ") + kTriangle, {"LookAt"});
    expect_error("CoordSysTransform \"nowhere\"", {"nowhere"});
    expect_error(std::string("ActiveTransform StartTime Translate 1 0 0 ActiveTransform All ") + kTriangle, {"moves"});
    expect_error("Transform [1 2 3]", {"Transform"});
    expect_error("ActiveTransform Sometimes", {"StartTime"});
}

TEST(ImportState, OrientationFollowsHandednessAndReversal) {
    EXPECT_FALSE(world(kTriangle).meshes[0].attributes.flip_normal);
    EXPECT_TRUE(world(std::string("ReverseOrientation ") + kTriangle).meshes[0].attributes.flip_normal);
    EXPECT_TRUE(world(std::string("Scale -1 1 1 ") + kTriangle).meshes[0].attributes.flip_normal);
    EXPECT_FALSE(world(std::string("Scale -1 1 1 ReverseOrientation ") + kTriangle).meshes[0].attributes.flip_normal);
    // A mirrored sphere is inside out, as in pbrt; but one that emits keeps its light outside.
    EXPECT_TRUE(world("Scale -1 1 1 Shape \"sphere\"").spheres[0].attributes.flip_normal);
    EXPECT_FALSE(world("Scale -1 1 1 ReverseOrientation Shape \"sphere\"").spheres[0].attributes.flip_normal);
    // So is one that becomes triangles, and a disk.
    const auto mesh_flips = [](const std::string& text) { return world(text).meshes.at(0).attributes.flip_normal; };
    EXPECT_FALSE(mesh_flips("Scale -1 1 2 Shape \"sphere\""));
    EXPECT_TRUE(mesh_flips("Scale -1 1 2 ReverseOrientation Shape \"sphere\""));
    EXPECT_FALSE(mesh_flips("Scale -1 1 1 Shape \"disk\""));
    EXPECT_TRUE(mesh_flips("Scale -1 1 1 AreaLightSource \"diffuse\" Shape \"disk\""));
    EXPECT_FALSE(world("Scale -1 1 1 AreaLightSource \"diffuse\" Shape \"sphere\"").spheres[0].attributes.flip_normal);
    EXPECT_TRUE(world("ReverseOrientation Shape \"sphere\"").spheres[0].attributes.flip_normal);
}

TEST(ImportState, AttributesAreDefaultsThatAShapeMayOverride) {
    const SceneDescription d = world(
        "AttributeBegin Attribute \"shape\" \"float radius\" 3 \"float alpha\" 0.5 Shape \"sphere\" Shape \"sphere\" "
        "\"float radius\" 2 AttributeEnd Shape \"sphere\"");
    ASSERT_EQ(d.spheres.size(), 3u);
    EXPECT_EQ(d.spheres[0].radius, 3);
    EXPECT_EQ(d.spheres[1].radius, 2);
    EXPECT_EQ(d.spheres[2].radius, 1);
    EXPECT_EQ(d.textures[size_t(d.spheres[1].attributes.alpha)].value.r, 0.5f);
    EXPECT_EQ(d.spheres[2].attributes.alpha, kNone);
    expect_error("Attribute \"hat\" \"float radius\" 3", {"hat"});
    for (const std::string target : {"shape", "light", "material", "texture"})
        expect_error("\nAttribute \"" + target + "\"\n\"float sclae\" 3\n" + kTriangle,
                     {"scene.pbrt:5", target.c_str(), "unknown parameter", "float sclae"});
    // What suits another kind of light is no mistake.
    EXPECT_TRUE(import_world("Attribute \"light\" \"float coneangle\" 20 LightSource \"point\"", {}, true).ok());
}

/// A default of the wrong type would be found by no directive, and so be as silent as a misspelt one.
TEST(ImportState, AttributesHaveTheTypesThatDirectivesAskFor) {
    struct Case {
        const char *target, *given, *right;
    };
    for (const Case& c : {Case{"shape", "\"integer radius\" 5", "write \"float radius\""},
                          Case{"shape", "\"string alpha\" \"a\"", "write \"float alpha\" or \"texture alpha\""},
                          Case{"light", "\"float I\" 2", "write \"rgb I\" or \"blackbody I\" or \"spectrum I\""},
                          Case{"material", "\"integer roughness\" 1", "write \"float roughness\" or \"texture roughness\""},
                          Case{"texture", "\"string invert\" \"true\"", "write \"bool invert\""}})
        expect_error("\nAttribute \"" + std::string(c.target) + "\"\n" + c.given + "\nShape \"sphere\"",
                     {"scene.pbrt:5: Attribute", "has the wrong type", c.right});
    expect_error("Attribute \"shape\" \"float radius\" 1 \"integer radius\" 2", {"scene.pbrt:3", "\"radius\"", "twice"});
    // pbrt's spellings of a type are one type; another directive's type is a default that this one does not have.
    EXPECT_TRUE(import_world("Attribute \"shape\" \"vector S\" [1 0 0] \"normal3 N\" [0 0 1] Shape \"sphere\"", {}, true).ok());
    const SceneDescription d = world(
        "Attribute \"material\" \"float eta\" 1.3 Material \"conductor\" Shape \"sphere\" "
        "Material \"dielectric\" Shape \"sphere\"");
    const Material& metal = d.materials.at(size_t(d.spheres[0].attributes.material));
    EXPECT_EQ(d.textures.at(size_t(metal.eta)).value, import::named_metal("metal-Cu")->eta);
    EXPECT_EQ(d.materials.at(size_t(d.spheres[1].attributes.material)).ior, 1.3f);
}

TEST(ImportState, ObjectsAreInstanced) {
    const SceneDescription d = world(std::string("ObjectBegin \"o\" Translate 1 0 0 ") + kTriangle +
                                     "Shape \"sphere\" ObjectEnd Translate 0 5 0 ObjectInstance \"o\" ObjectInstance \"o\"");
    ASSERT_EQ(d.objects.size(), 1u);
    ASSERT_EQ(d.instances.size(), 2u);
    EXPECT_TRUE(d.meshes.empty());
    expect_near(d.objects[0].meshes[0].positions[0], {1, 0, 0});
    EXPECT_EQ(d.objects[0].spheres.size(), 1u);
    expect_near(d.instances[1].object_to_world.point({0, 0, 0}), {0, 5, 0});
    expect_error("\nObjectInstance \"x\"\nObjectBegin \"y\" ObjectEnd", {"scene.pbrt:4", "\"x\"", "ObjectBegin"});
    // As in pbrt, the object may come later.
    const SceneDescription early = world("Translate 0 5 0 ObjectInstance \"p\" ObjectInstance \"o\" Identity ObjectBegin \"o\" " +
                                         std::string(kTriangle) + "ObjectEnd ObjectBegin \"p\" Shape \"sphere\" ObjectEnd");
    ASSERT_EQ(early.instances.size(), 2u);
    EXPECT_EQ(early.instances[0].object, 1);
    EXPECT_EQ(early.instances[1].object, 0);
    expect_near(early.instances[1].object_to_world.point({0, 0, 0}), {0, 5, 0});
    expect_error("ObjectBegin \"x\" ObjectBegin \"y\"", {"inside"});
    expect_error("ObjectBegin \"x\" ObjectEnd ObjectBegin \"x\"", {"twice"});
    expect_error("ObjectBegin \"x\" ObjectInstance \"x\"", {"nested"});
    expect_warning(std::string("AreaLightSource \"diffuse\" ObjectBegin \"o\" ") + kTriangle + "ObjectEnd", "ignored, as in pbrt");
}

TEST(ImportState, ScopesMustMatch) {
    expect_error("AttributeBegin", {"scene.pbrt:3", "never closed"});
    expect_error("AttributeEnd", {"AttributeEnd"});
    expect_error("AttributeBegin ObjectEnd", {"does not match"});
    for (const std::string begun : {"Attribute", "Transform", "Object"}) {
        const std::string begin = begun + "Begin" + (begun == "Object" ? " \"o\"" : "");
        expect_error("\n" + begin, {"scene.pbrt:4", ("this " + begun + "Begin is never closed").c_str(), (begun + "End").c_str()});
        for (const std::string ended : {"Attribute", "Transform", "Object"})
            if (ended != begun)
                expect_error(begin + "\n\n" + ended + "End", {("scene.pbrt:5: " + ended + "End does not match").c_str(),
                                                              (begun + "Begin at scene.pbrt:3").c_str(), (begun + "End").c_str()});
    }
    expect_error("\nWorldBegin", {"scene.pbrt:4", "second WorldBegin"});
    std::string deep;
    for (int i = 0; i < 2000; ++i) deep += "AttributeBegin ";
    expect_error(deep, {"nested deeper"});
}

TEST(ImportFiles, IncludeKeepsTheStateAndImportDoesNot) {
    const testing::FileMap files{{"sub/more.pbrt", std::string("Translate 1 0 0\n") + kTriangle}};
    const SceneDescription include = world(std::string("Include \"sub/more.pbrt\" ") + kTriangle, files);
    expect_near(first_corner(include, 1), {1, 0, 0});
    EXPECT_EQ(include.meshes[0].attributes.source, "sub/more.pbrt:2");
    expect_near(first_corner(world(std::string("Import \"sub/more.pbrt\" ") + kTriangle, files), 1), {0, 0, 0});
    // An imported file has scopes of its own.
    expect_error("AttributeBegin Import \"a.pbrt\" AttributeEnd", {"a.pbrt:1", "AttributeEnd", "imported file"},
                 {{"a.pbrt", "AttributeEnd AttributeBegin"}});
    expect_error("Import \"a.pbrt\"", {"scene.pbrt:3", "open", "a.pbrt:2"}, {{"a.pbrt", "\nTransformBegin"}});
    EXPECT_TRUE(import_world("AttributeBegin Import \"a.pbrt\" AttributeEnd", {{"a.pbrt", "AttributeBegin AttributeEnd"}}).ok());
    const auto scene = import_world("Include \"./sub//../sub/more.pbrt\"", files);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->files, (std::vector<std::string>{"scene.pbrt", "sub/more.pbrt"}));
}

TEST(ImportFiles, ReferencesStayInTheDirectoryAndEnd) {
    expect_error("Include \"missing.pbrt\"", {"scene.pbrt:3", "missing.pbrt"});
    expect_error("Include \"/etc/passwd\"", {"absolute"});
    expect_error("Include \"a/../../b.pbrt\"", {"leaves"});
    expect_error("Include \"scene.pbrt\"", {"scene.pbrt:3", "circle: scene.pbrt > scene.pbrt"});
    expect_error("Include \"a.pbrt\"", {"b.pbrt:2", "circle: a.pbrt > b.pbrt > a.pbrt"},
                 {{"a.pbrt", "Include \"b.pbrt\""}, {"b.pbrt", "\nInclude \"./a.pbrt\""}});
    testing::FileMap chain;
    for (int i = 0; i < 99; ++i) chain[std::to_string(i) + ".pbrt"] = "Include \"" + std::to_string(i + 1) + ".pbrt\"";
    expect_error("Include \"0.pbrt\"", {"63.pbrt:1", "deeper than 64"}, chain);
    expect_error("Shape \"plymesh\" \"string filename\" \"../a.ply\"", {"leaves"});
    testing::FileMap laughs{{"9.pbrt", ""}};
    for (int i = 0; i < 9; ++i) {
        const std::string line = "Include \"" + std::to_string(i + 1) + ".pbrt\"\n";
        for (int k = 0; k < 10; ++k) laughs[std::to_string(i) + ".pbrt"] += line;
    }
    expect_error("Include \"0.pbrt\"", {"as often as it is included"}, laughs);
    EXPECT_FALSE(import_pbrt("/nowhere/at/all.pbrt").ok());
    EXPECT_FALSE(import_pbrt("/").ok());
}

TEST(ImportSyntax, ValuesWithAndWithoutBrackets) {
    const SceneDescription d = world(
        "Shape \"sphere\" \"float radius\" 2 # a comment \" [ \n Shape \"sphere\" \"float radius\" [ 2 ] "
        "Shape\"sphere\"\"float  radius\"[+2.0e0]\n"
        "Material \"conductor\" \"bool remaproughness\" \"false\" Shape \"sphere\" Material \"conductor\" \"bool "
        "remaproughness\" [false] Shape \"sphere\"");
    ASSERT_EQ(d.spheres.size(), 5u);
    for (size_t i = 0; i < 3; ++i) EXPECT_EQ(d.spheres[i].radius, 2);
    for (size_t i = 3; i < 5; ++i) EXPECT_FALSE(d.materials[size_t(d.spheres[i].attributes.material)].remap_roughness);
}

TEST(ImportSyntax, Errors) {
    expect_error("Frobnicate", {"scene.pbrt:3", "Frobnicate"});
    expect_error("Shape \"sphere\" \"float radius\" [1", {"not closed"});
    expect_error("Shape \"sphere\" \"float radius\"", {"no value"});
    expect_error("Shape \"sphere\" \"float radius\" []", {"no value"});
    expect_error("Shape \"sphere\" \"float radius\" [1 2]", {"1 value"});
    expect_error("Shape \"sphere\" \"float radius\" \"big\"", {"big"});
    expect_error("Shape \"sphere\" \"float radius\" 1e999", {"finite"});
    expect_error("Shape \"sphere\" \"float radius\" 1e60", {"single precision"});
    expect_error("Shape \"sphere\" \"integer radius\" 1", {"wrong type", "float radius"});
    expect_error("Shape \"sphere\" \"float radios\" 1", {"unknown parameter", "radios"});
    expect_error("Shape \"sphere\" \"float radius\" 1 \"float radius\" 2", {"twice"});
    expect_error("Shape \"sphere\" \"float radius\" 1\n\"integer radius\" 2", {"scene.pbrt:4", "\"radius\"", "twice", "sphere"});
    expect_error("Material \"diffuse\" \"integer reflectance\" 1",
                 {"write \"texture reflectance\" or \"rgb reflectance\" or \"spectrum reflectance\""});
    expect_error("Shape \"sphere\" \"number radius\" 1", {"number"});
    expect_error("Shape \"sphere\" \"radius\" 1", {"float radius"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1]", {"multiple of 3"});
    expect_error("Shape \"trianglemesh\" \"integer indices\" [0.5 1 2]", {"32-bit integer"});
    expect_error("Shape \"sphere", {"inside a quoted string"});
    expect_error("Shape \"sp\nhere\"", {"closed"});
    expect_error("Shape sphere", {"quoted"});
    expect_error("Shape", {"quoted"});
    expect_error("\"Shape\"", {"expected a directive"});
    EXPECT_FALSE(import_text("").ok());
    EXPECT_FALSE(import_text("Shape \"sphere\"").ok());
    EXPECT_FALSE(import_text("WorldBegin Camera \"perspective\"").ok());
    EXPECT_FALSE(import_text(std::string("WorldBegin \0\xff\xfe", 14)).ok());
}

TEST(ImportOptions, CameraFilmAndDepth) {
    const auto scene = import_text(
        "Transform [-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1] LookAt 1 2 3 1 2 8 0 1 0\n"
        "Camera \"perspective\" \"float fov\" 40 \"float lensradius\" 0.1 \"float focaldistance\" 7 \"float "
        "screenwindow\" [-1 1 -2 2] \"float shutterclose\" 0.5\n"
        "Film \"rgb\" \"integer xresolution\" 400 \"integer yresolution\" 200 \"float cropwindow\" [0 0.5 0.25 1] "
        "\"float iso\" 400\n"
        "Sampler \"stratified\" \"integer xsamples\" 3 \"integer ysamples\" 2 \"bool jitter\" true Integrator "
        "\"volpath\" \"integer maxdepth\" 9 ColorSpace \"srgb\"\n"
        "PixelFilter \"box\" \"float xradius\" 0.5 WorldBegin");
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    const SceneDescription& d = scene->description;
    EXPECT_TRUE(d.warnings.empty());
    expect_near(d.camera.camera_to_world.point({0, 0, 0}), {1, 2, 3});
    // LookAt alone puts camera +x at world -x for this up vector; the Transform mirrors it.
    expect_near(d.camera.camera_to_world.vector({1, 0, 0}), {-1, 0, 0});
    EXPECT_TRUE(d.camera.camera_to_world.swaps_handedness());
    EXPECT_EQ(d.camera.fov_degrees, 40);
    EXPECT_EQ(d.camera.lens_radius, 0.1f);
    EXPECT_TRUE(d.camera.has_screen_window);
    EXPECT_EQ(d.camera.screen_window[3], 2);
    const int crop[4] = {0, 200, 50, 200};
    for (int i = 0; i < 4; ++i) EXPECT_EQ(d.film.crop[i], crop[i]);
    EXPECT_FLOAT_EQ(d.film.response.exposure, 2);
    EXPECT_EQ(d.samples_per_pixel, 6);
    EXPECT_EQ(d.max_depth, 9);
}

/// What an integrator means is the client's business, and the command line says where the picture goes; the description keeps what
/// the file says.
TEST(ImportOptions, IntegratorAndFileNameAreKept) {
    for (const std::string name : {"path", "volpath", "bdpt", "sppm"}) {
        const auto scene = import_text(
            "PixelFilter \"box\" Integrator \"" + name + "\" Film \"rgb\" \"string filename\" \"foo.exr\" WorldBegin", {}, true);
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        EXPECT_EQ(scene->description.integrator, name);
        EXPECT_EQ(scene->description.film.file_name, "foo.exr");
    }
}

TEST(ImportOptions, LimitsAreThoseOfTheRenderer) {
    static_assert(import::kMaxDepth == kMaxEdges - 1);
    const auto accepted = [](const std::string& text) {
        const auto scene = import_text("PixelFilter \"box\" " + text + " WorldBegin");
        EXPECT_TRUE(scene.ok()) << scene.status().message();
    };
    accepted("Integrator \"path\" \"integer maxdepth\" 255");
    accepted("Film \"rgb\" \"integer xresolution\" 16384 \"integer yresolution\" 16384");
    // A crop is what must fit.
    accepted("Film \"rgb\" \"integer xresolution\" 60000 \"integer yresolution\" 60000 \"float cropwindow\" [0 .1 0 .1]");
}

TEST(ImportOptions, CamerasStayWithinSinglePrecision) {
    const auto camera = [](const std::string& options, const std::string& before = "") {
        return import_text(before + "\nCamera \"perspective\" " + options + " WorldBegin");
    };
    const auto refused = [&](const char* part, const std::string& options, const std::string& before = "") {
        const auto scene = camera(options, before);
        ASSERT_FALSE(scene.ok()) << before << options;
        EXPECT_NE(scene.status().message().find("scene.pbrt:2: Camera"), std::string::npos) << scene.status().message();
        EXPECT_NE(scene.status().message().find(part), std::string::npos) << scene.status().message();
    };
    const auto lens = [](const std::string& radius, const std::string& distance) {
        return "\"float lensradius\" " + radius + " \"float focaldistance\" " + distance;
    };
    refused("lensradius", lens("0.1", "1e20"));
    refused("lensradius", lens("0.1", "3e38"));
    refused("lensradius", lens("1e19", "1"));
    refused("lensradius", lens("1e-38", "1e-38"));
    refused("lensradius", lens("1", "1e-10"));
    refused("lensradius", lens("0.1", "1e6"), "Scale 1e-12 1e-12 1e-12");
    EXPECT_TRUE(camera(lens("0.1", "1e14")).ok());
    EXPECT_TRUE(camera(lens("0", "3e38")).ok());  // A pinhole has no focus.
    for (const std::string look : {"1e18 0 0  0 0 0", "1e19 0 0  0 0 0", "0 0 0  0 0 3e38"}) {
        const auto scene = camera("", "LookAt " + look + "  0 1 0");
        ASSERT_FALSE(scene.ok()) << look;
        EXPECT_NE(scene.status().message().find("scene.pbrt:1: LookAt: the eye or the target lies beyond 1e15"), std::string::npos)
            << scene.status().message();
    }
    refused("position", "", "Translate 0 0 1e16");
    refused("scales", "", "Scale 1e-17 1e-17 1e-17");
    refused("scales", "", "Scale 1e17 1e17 1e17");
    refused("shears", "", "Scale 1 2 1");
    refused("shears", "", "Transform [1 0 0 0  0.5 1 0 0  0 0 1 0  0 0 0 1]");
    EXPECT_TRUE(camera("", "Rotate 30 1 2 3 Scale -2 2 2").ok());
    for (const std::string window : {"-1e20 1e20 -1 1", "-1 1 -1e20 1e20", "-1e-20 1e-20 -1 1", "-1 1 1e7 2e7"})
        refused("screenwindow", "\"float screenwindow\" [" + window + "]");
    refused("frameaspectratio", "\"float frameaspectratio\" 1e20");
    refused("frameaspectratio", "\"float frameaspectratio\" 1e-20");
    refused("fov", "\"float fov\" 1e-20");
    EXPECT_TRUE(camera("\"float fov\" 1 \"float screenwindow\" [-100 100 -50 50]").ok());
}

TEST(ImportOptions, DefaultsAreThoseOfPbrt) {
    const auto scene = import_text("WorldBegin");
    ASSERT_TRUE(scene.ok());
    const SceneDescription& d = scene->description;
    EXPECT_EQ(d.film.width, 1280);
    EXPECT_EQ(d.film.height, 720);
    EXPECT_EQ(d.film.response.exposure, 1);
    EXPECT_EQ(d.camera.fov_degrees, 90);
    EXPECT_EQ(d.camera.focal_distance, 1e6f);
    EXPECT_EQ(d.max_depth, 5);
    EXPECT_EQ(d.samples_per_pixel, 16);
    ASSERT_EQ(d.warnings.size(), 1u);
    EXPECT_NE(d.warnings[0].find("gaussian"), std::string::npos);
    EXPECT_FALSE(import_text("WorldBegin", {}, true).ok());
}

TEST(ImportOptions, UnsupportedOnesAreNamed) {
    const auto refused = [](const std::string& text, const char* part) {
        const auto scene = import_text(text + " WorldBegin");
        ASSERT_FALSE(scene.ok()) << text;
        EXPECT_NE(scene.status().message().find(part), std::string::npos) << scene.status().message();
    };
    const auto warned = [](const std::string& text, const char* part) {
        const bool filter = text.find("PixelFilter") != std::string::npos;
        const auto scene = import_text((filter ? "" : "PixelFilter \"box\" ") + text + " WorldBegin");
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        ASSERT_EQ(scene->description.warnings.size(), 1u) << text;
        EXPECT_NE(scene->description.warnings[0].find(part), std::string::npos) << scene->description.warnings[0];
    };
    refused("Camera \"realistic\"", "perspective");
    refused("Camera \"perspective\" \"float fov\" 180", "fov");
    refused("Film \"spectral\"", "rgb");
    refused("\nFilm \"rgb\" \"integer xresolution\" 16384 \"integer yresolution\" 16385", "scene.pbrt:2");
    refused("Film \"rgb\" \"integer xresolution\" 16384 \"integer yresolution\" 16385", "268451840 pixels, which take 35 GB");
    refused("\nIntegrator \"path\" \"integer maxdepth\" -1", "scene.pbrt:2");
    refused("Integrator \"path\" \"integer maxdepth\" -1", "negative");
    warned("Integrator \"path\" \"integer maxdepth\" 1000", "255");
    refused("Film \"rgb\" \"integer xresolution\" 0", "resolution");
    refused("Film \"rgb\" \"integer xresolution\" 2000000000", "resolution");
    refused("Film \"rgb\" \"float cropwindow\" [0.5 0.5 0 1]", "empty");
    for (const std::string wrong : {"[0.7 0.3 0 1]", "[0 1 0.7 0.3]"})
        refused("\n\nFilm \"rgb\"\n\"float cropwindow\" " + wrong, "scene.pbrt:4: Film \"rgb\": cropwindow has");
    refused("Film \"rgb\" \"float cropwindow\" [0 1 0.7 0.3]", "y0 above y1");
    refused("Film \"rgb\" \"float cropwindow\" [0.50001 0.50002 0 1]", "no pixel lies between x0 and x1");
    for (const std::string wrong : {"[0 1.2 0 1]", "[-0.1 1 0 1]", "[0 1 0 1e30]"})
        refused("Film \"rgb\" \"float cropwindow\" " + wrong, "cropwindow must lie in [0, 1]");
    refused("Film \"rgb\" \"float cropwindow\" [0 1 0 1 0 1 0 1]", "four numbers");
    refused("Film \"rgb\" \"integer pixelbounds\" [0 1281 0 10]", "outside of the image, which is 1280 pixels wide");
    refused("Film \"rgb\" \"integer pixelbounds\" [0 10 -1 10]", "outside of the image, which is 720 pixels high");
    refused("Film \"rgb\" \"integer pixelbounds\" [0 10 20 10]", "pixelbounds has y0 above y1");
    refused("Film \"rgb\" \"integer pixelbounds\" [10 10 0 10]", "empty");
    refused("Film \"rgb\" \"integer pixelbounds\" [0 9 0 9] \"float cropwindow\" [0 1 0 1]", "not both");
    refused("Integrator \"ambientocclusion\"", "ambientocclusion");
    refused("\nIntegrator \"volpaht\"", "scene.pbrt:2: Integrator \"volpaht\" is unknown");
    refused("PixelFilter \"gaussian\" \"integer sigma\" 1", "write \"float sigma\"");
    refused("PixelFilter \"triangle\" \"float sigma\" 1", "unknown parameter");
    refused("Sampler \"stratified\" \"integer pixelsamples\" 4", "unknown parameter");
    refused("Sampler \"stratified\" \"integer xsamples\" -2 \"integer ysamples\" -2", "positive");
    refused("Camera \"perspective\" \"integer frameaspectratio\" 2", "write \"float frameaspectratio\"");
    refused("Integrator \"path\" \"integer depth\" 3", "depth");
    refused("ColorSpace \"rec2020\"", "srgb");
    refused("Option \"bool forcediffuse\" true", "forcediffuse");
    refused("Option \"bool nonsense\" true", "nonsense");
    warned("Film \"rgb\" \"float maxcomponentvalue\" 10", "not clamped");
    warned("PixelFilter \"gaussian\"", "box");
    warned("PixelFilter \"box\" \"float xradius\" 1", "radius");
    warned("Integrator \"path\" \"bool regularize\" true", "regularize");
    warned("Integrator \"bdpt\" \"string lightsampler\" \"power\"", "lightsampler");
    warned("Sampler \"halton\" \"integer seed\" 3", "--seed");
    warned("Accelerator \"bvh\" \"string splitmethod\" \"sah\"", "Accelerator");
    warned("Option \"integer seed\" 3", "seed");
}

TEST(ImportState, Media) {
    EXPECT_TRUE(world("MediumInterface \"\" \"\"").warnings.empty());
    expect_warning("MakeNamedMedium \"fog\" \"string type\" \"homogeneous\"", "fog");
    expect_warning("Attribute \"medium\"\n\"float nonsense\" 1",
                   "scene.pbrt:4: Attribute \"medium\": \"float nonsense\" is ignored");
    expect_error("MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" MediumInterface \"fog\"", {"media"});
}

TEST(ImportDiagnostics, RepeatedWarningsAreCounted) {
    const SceneDescription d = world("Shape \"disk\" Shape \"disk\" Shape \"disk\"");
    ASSERT_EQ(d.warnings.size(), 1u);
    EXPECT_NE(d.warnings[0].find("and 2 more"), std::string::npos);
}

}  // namespace
}  // namespace lightloom
