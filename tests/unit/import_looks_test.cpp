// Materials, lights and spectra.

#include <array>
#include <cmath>

#include "common/import/spectra.h"
#include "import_looks.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::exr;
using testing::FileMap;
using testing::import_world;
using testing::kShape;
using testing::material_of;
using testing::tga;
using testing::value;
using testing::world;

TEST(ImportMaterial, DefaultsAreThoseOfPbrt) {
    SceneDescription d = world(kShape);
    EXPECT_EQ(material_of(d).kind, MaterialKind::kDiffuse);
    EXPECT_EQ(value(d, material_of(d).reflectance), Rgb(0.5f));
    d = world("Material \"diffusetransmission\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).reflectance), Rgb(0.25f));
    EXPECT_EQ(value(d, material_of(d).transmittance), Rgb(0.25f));
    d = world("Material \"diffusetransmission\" \"float scale\" 2" + kShape);
    EXPECT_EQ(value(d, material_of(d).transmittance), Rgb(0.5f));
    d = world("Material \"conductor\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), import::named_metal("metal-Cu")->eta);
    EXPECT_EQ(value(d, material_of(d).k), import::named_metal("metal-Cu")->k);
    EXPECT_EQ(value(d, material_of(d).roughness_u), Rgb(0.0f));
    EXPECT_TRUE(material_of(d).remap_roughness);
    d = world("Material \"dielectric\" \"float vroughness\" 0.3 \"float roughness\" 0.1 \"bool remaproughness\" false" + kShape);
    EXPECT_EQ(material_of(d).ior, 1.5f);
    EXPECT_EQ(value(d, material_of(d).roughness_u), Rgb(0.1f));
    EXPECT_EQ(value(d, material_of(d).roughness_v), Rgb(0.3f));
    EXPECT_FALSE(material_of(d).remap_roughness);
    d = world("Material \"coateddiffuse\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).reflectance), Rgb(0.5f));
    EXPECT_EQ(value(d, material_of(d).roughness_u), Rgb(0.0f));
    EXPECT_EQ(material_of(d).ior, 1.5f);
    d = world(
        "Material \"coatedconductor\" \"float interface.roughness\" 0.1 \"float conductor.roughness\" 0.2 \"rgb "
        "reflectance\" [0.1 0.2 0.3]" +
        kShape);
    EXPECT_EQ(value(d, material_of(d).roughness_u), Rgb(0.1f));
    EXPECT_EQ(value(d, material_of(d).base_roughness_v), Rgb(0.2f));
    EXPECT_EQ(value(d, material_of(d).reflectance), Rgb(0.1f, 0.2f, 0.3f));
}

TEST(ImportMaterial, NamedOnesMayComeLaterAndMix) {
    const SceneDescription d =
        world("NamedMaterial \"m\"" + kShape +
              "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.25\n"
              "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string type\" \"dielectric\"");
    const Material m = material_of(d);
    EXPECT_EQ(m.kind, MaterialKind::kMix);
    EXPECT_EQ(m.name, "m");
    EXPECT_EQ(d.materials[size_t(m.mix_b)].kind, MaterialKind::kDielectric);
    EXPECT_EQ(value(d, m.mix_amount), Rgb(0.25f));
    expect_error("MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"]", {"itself"});
    expect_error("NamedMaterial \"x\"" + kShape, {"scene.pbrt:3", "\"x\""});
    expect_error("MakeNamedMaterial \"x\"", {"type"});
    expect_error("MakeNamedMaterial \"x\" \"string type\" \"diffuse\" MakeNamedMaterial \"x\" \"string type\" \"diffuse\"",
                 {"twice"});
    std::string chain = "MakeNamedMaterial \"m0\" \"string type\" \"diffuse\"";
    for (int i = 1; i < 40; ++i) {
        const std::string previous = "\"m" + std::to_string(i - 1) + "\"";
        chain += " NamedMaterial " + previous + kShape + "MakeNamedMaterial \"m" + std::to_string(i) +
                 "\" \"string type\" \"mix\" \"string materials\" [" + previous + previous + "]";
    }
    expect_error(chain, {"32 levels"});
}

TEST(ImportMaterial, InterfaceShapesDoNotExist) {
    const SceneDescription d = world("Material \"interface\"" + kShape);
    EXPECT_TRUE(d.spheres.empty() && d.warnings.empty());
    expect_warning("AreaLightSource \"diffuse\" Material \"interface\"" + kShape, "ignored, as in pbrt");
}

TEST(ImportMaterial, WhatIsNotModelledIsNamed) {
    expect_error("Material \"hair\"", {"hair", "not supported"});
    expect_error("Material \"diffuse\" \"rgb reflectance\" [1.5 0 0]", {"above 1"});
    expect_error("Material \"diffuse\" \"rgb reflectance\" [-1 0 0]", {"negative"});
    expect_error("Material \"diffuse\" \"float reflectance\" 0.5", {"wrong type"});
    expect_error("Material \"diffuse\" \"float sheen\" 1", {"unknown parameter", "sheen"});
    expect_error("Material \"conductor\" \"rgb reflectance\" [1 1 1] \"rgb eta\" [1 1 1]", {"not both"});
    expect_error("Material \"conductor\" \"spectrum eta\" \"metal-Xx-eta\"", {"metal-Xx"});
    expect_error("Material \"dielectric\" \"float roughness\" 2", {"[0, 1]"});
    expect_error("Material \"conductor\" \"float eta\" 2" + kShape, {"float eta", "wrong type", "spectrum eta"});
    expect_error("Material \"diffuse\" \"float type\" 2", {"float type", "wrong type"});
    expect_error("Material \"coateddiffuse\" \"integer g\" 0", {"integer g", "wrong type"});
    expect_error("Material \"dielectric\" \"float eta\" 0", {"index"});
    for (const std::string kind : {"coateddiffuse", "coatedconductor"}) {
        const std::string coat = "Material \"" + kind + "\" ";
        expect_error(coat + "\"float g\" 0.1", {"scene.pbrt:3", "float g", "medium"});
        expect_error(coat + "\"rgb albedo\" [0 0.1 0]", {"scene.pbrt:3", "rgb albedo", "medium"});
        expect_error(coat + "\"texture albedo\" \"t\"", {"texture albedo", "medium"});
        EXPECT_TRUE(world(coat + "\"float g\" 0 \"rgb albedo\" [0 0 0]").warnings.empty());
        for (const char* name : {"maxdepth", "nsamples"}) {
            expect_error(coat + "\"integer " + name + "\" 10001", {"scene.pbrt:3", name, "10000"});
            expect_error(coat + "\"integer " + name + "\" 0", {name, "between 1"});
        }
    }
    expect_warning("Material \"coatedconductor\" \"integer maxdepth\" 7", "maxdepth");
    expect_warning("Material \"coateddiffuse\" \"integer nsamples\" 4", "nsamples");
    const Material coat = material_of(world("Material \"coateddiffuse\" \"float thickness\" 0.1 \"integer maxdepth\" 7" + kShape));
    EXPECT_EQ(coat.thickness, 0.1f);
    EXPECT_EQ(coat.layer_events, 7);
    expect_warning("Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"" + kShape, "dispersion");
    EXPECT_NEAR(material_of(world("Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"" + kShape)).ior, 1.5168, 1e-4);
}

TEST(ImportMaterial, RoughnessLiesBetweenZeroAndOne) {
    for (const std::string remap : {"", " \"bool remaproughness\" false"})
        for (const std::string name : {"roughness", "uroughness", "vroughness"}) {
            const std::string material = "Material \"conductor\"" + remap + "\n", value = "\"float " + name + "\" ";
            const std::string texture = "Texture \"t\" \"float\" ", use = material + "\"texture " + name + "\" \"t\"";
            for (const std::string wrong : {"-0.1", "1.5"}) {
                expect_error(material + value + wrong, {"scene.pbrt:4", (": " + name + " must").c_str(), "[0, 1]", wrong.c_str()});
                expect_error(texture + "\"constant\" \"float value\" " + wrong + " " + use,
                             {name.c_str(), "[0, 1]", wrong.c_str()});
                const std::string range = wrong == "1.5" ? "from 0 to 1.5" : "from -0.1 to 0";
                const std::string squares = "\"checkerboard\" \"float tex1\" 0 \"float tex2\" " + wrong + "\n";
                expect_warning(texture + squares + use, (name + " may reach " + range).c_str());
            }
            EXPECT_TRUE(import_world(material + value + "0" + kShape + material + value + "1" + kShape, {}, true).ok());
        }
    for (const std::string name : {"interface.uroughness", "conductor.roughness"})
        expect_error("Material \"coatedconductor\" \"float " + name + "\" 2", {name.c_str(), "[0, 1]"});
}

/// What a texture may reach follows from what it is made of.
TEST(ImportMaterial, RoughnessOfTexturesIsBounded) {
    const testing::FileMap files{{"g.tga", tga(2, 1, "abcxyz")},
                                 {"grey.png", testing::png(2, 1, 0, std::string("\0\x10\x66", 3))},  // 0.4 at most
                                 {"bright.exr", exr(Rgb(4), {0.64f, 0.33f, 0.3f, 0.6f, 0.15f, 0.06f, 0.3127f, 0.329f})}};
    const std::string use = " Material \"dielectric\" \"texture roughness\" \"t\"", linear = "\"string encoding\" \"linear\" ";
    const auto image = [](const std::string& name, const std::string& file, const std::string& options) {
        return "Texture \"" + name + "\" \"float\" \"imagemap\" \"string filename\" \"" + file + "\" " + options + " ";
    };
    for (const std::string& fine :
         {image("t", "g.tga", ""), image("t", "g.tga", "\"bool invert\" true"),
          image("t", "grey.png", linear + "\"float scale\" 2"), image("t", "bright.exr", "\"float scale\" 0.25"),
          image("i", "g.tga", "") + "Texture \"t\" \"float\" \"mix\" \"float tex1\" 0 \"float tex2\" 1 \"texture amount\" \"i\"",
          image("i", "bright.exr", "") + "Texture \"t\" \"float\" \"scale\" \"texture tex\" \"i\" \"float scale\" 0.25"})
        EXPECT_TRUE(import_world(fine + use, files, true).ok()) << import_world(fine + use, files, true).status().message();
    expect_warning(image("t", "grey.png", linear + "\"float scale\" 3") + use, "to 1.2, beyond [0, 1]", files);
    // One value, but none that the file gives.
    expect_warning(image("t", "bright.exr", "") + use, "roughness is 4, beyond [0, 1]", files);
    expect_warning("Texture \"t\" \"float\" \"scale\" \"float tex\" 4 \"float scale\" 0.5" + use, "roughness is 2, beyond [0, 1]");
    expect_warning(image("t", "bright.exr", "\"string wrap\" \"black\"") + use, "may reach from 0 to 4", files);
    expect_warning(image("i", "bright.exr", "") + image("j", "g.tga", "\"string wrap\" \"black\"") +
                       "Texture \"t\" \"float\" \"mix\" \"texture tex1\" \"j\" \"float tex2\" 1 \"texture amount\" \"i\"" + use,
                   "to 4, beyond [0, 1]", files);
    // Products beyond double precision are no numbers that would pass for good ones.
    std::string huge = "Texture \"t0\" \"float\" \"checkerboard\" \"float tex1\" 1e38 \"float tex2\" -1e38 ";
    for (int i = 1; i < 10; ++i)
        huge += "Texture \"t" + std::to_string(i) + "\" \"float\" \"scale\" \"texture tex\" \"t" + std::to_string(i - 1) +
                "\" \"texture scale\" \"t" + std::to_string(i - 1) + "\" ";
    huge += "Texture \"t\" \"float\" \"scale\" \"texture tex\" \"t9\" \"float scale\" 0";
    expect_warning(huge + use, "beyond [0, 1]");
}

TEST(ImportLight, AreaLights) {
    SceneDescription d = world("AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2 \"bool twosided\" true" + kShape);
    ASSERT_EQ(d.emissions.size(), 1u);
    EXPECT_EQ(d.emissions[0].radiance, Rgb(2, 4, 6));
    EXPECT_TRUE(d.emissions[0].two_sided);
    EXPECT_EQ(d.spheres[0].attributes.emission, 0);
    // A sphere of radius 1: flux = pi * area * radiance.
    d = world("AreaLightSource \"diffuse\" \"float power\" 10" + kShape);
    EXPECT_NEAR(d.emissions[0].radiance.g, 10 / (3.14159265 * 4 * 3.14159265), 1e-5);
    // As in pbrt, the power is each triangle's: a 1 x 3 rectangle of two triangles gets one radiance for its area
    // of 1.5.
    const std::string quad = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 3 0 0 3 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3]";
    d = world("AreaLightSource \"diffuse\" \"float power\" 10 " + quad);
    ASSERT_EQ(d.meshes.size(), 1u);
    EXPECT_NEAR(d.emissions.at(0).radiance.g, 10 / (3.14159265 * 1.5), 1e-5);
    EXPECT_NE(d.warnings.at(0).find("each of the 2 triangles"), std::string::npos);
    const std::string uneven = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 0 9 9] \"integer indices\" [0 1 2 1 2 3]";
    d = world("AreaLightSource \"diffuse\" \"float power\" 10 " + uneven);
    EXPECT_EQ(d.meshes.size(), 2u);
    EXPECT_EQ(d.emissions.size(), 2u);
    expect_error("AreaLightSource \"diffuse\" \"float strength\" 2" + kShape, {"strength"});
    // Also where no shape emits with it.
    expect_error("AreaLightSource \"diffuse\"\n\"float strength\" 2", {"scene.pbrt:4", "unknown parameter", "strength"});
    expect_error("AreaLightSource \"diffuse\" \"integer scale\" 2", {"wrong type", "float scale"});
    expect_error("AreaLightSource \"sphere\"", {"diffuse"});
    expect_error("AreaLightSource \"diffuse\" Shape \"sphere\" \"float alpha\" 0.5", {"emitting shape with an alpha"});
    expect_error("AreaLightSource \"diffuse\" \"rgb L\" [1e30 1 1] \"float scale\" 1e30" + kShape, {"finite"});
}

TEST(ImportLight, AlphaZeroHidesTheShapeAndLeavesTheLight) {
    const std::string light = "AreaLightSource \"diffuse\" \"float power\" 10 ";
    const std::string quad = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 3 0 0 3 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3]";
    const std::string zero = "Texture \"none\" \"float\" \"constant\" \"float value\" 0 ";
    for (const std::string alpha : {" \"float alpha\" 0", " \"texture alpha\" \"none\""}) {
        const SceneDescription d = world(zero + light + kShape + alpha + " " + quad + alpha);
        EXPECT_TRUE(d.meshes.empty() && d.spheres.empty());
        ASSERT_EQ(d.hidden_spheres.size(), 1u);
        ASSERT_EQ(d.hidden_meshes.size(), 1u);
        EXPECT_EQ(d.hidden_spheres[0].attributes.alpha, kNone);
        EXPECT_NEAR(d.emissions.at(size_t(d.hidden_meshes[0].attributes.emission)).radiance.g, 10 / (3.14159265 * 1.5), 1e-5);
    }
    const SceneDescription dark = world("AreaLightSource \"diffuse\" \"rgb L\" [0 0 0]" + kShape + "\"float alpha\" 0");
    EXPECT_TRUE(dark.spheres.empty() && dark.hidden_spheres.empty());
    expect_error("Texture \"half\" \"float\" \"constant\" \"float value\" 0.5 " + light + kShape + "\"texture alpha\" \"half\"",
                 {"emitting shape with an alpha"});
}

TEST(ImportLight, AnImageOnAnAreaLight) {
    // Two pixels: white, and black of which sRGB makes nothing.
    const FileMap files{{"a.tga", tga(2, 1, std::string("\xff\xff\xff", 3) + std::string(3, '\0'))},
                        {"black.tga", tga(1, 1, std::string(3, '\0'))}};
    const std::string light = "AreaLightSource \"diffuse\" \"string filename\" \"a.tga\" ";
    SceneDescription d = world(light + "\"float scale\" 3 \"bool twosided\" true" + kShape, files);
    EXPECT_TRUE(d.warnings.empty());
    ASSERT_EQ(d.emissions.size(), 1u);
    EXPECT_EQ(d.emissions[0].radiance, Rgb(3.0f));
    EXPECT_TRUE(d.emissions[0].two_sided);
    EXPECT_EQ(d.images.at(size_t(d.emissions[0].image)).width, 2);
    // The power is that of all of the image, half of which is white.
    d = world(light + "\"float power\" 10" + kShape, files);
    EXPECT_NEAR(d.emissions.at(0).radiance.g, 2 * 10 / (3.14159265 * 4 * 3.14159265), 1e-5);
    d = world(light + kShape + "AreaLightSource \"diffuse\"" + kShape, files);
    EXPECT_EQ(d.emissions.size(), 2u) << "one with the image and one without";
    expect_error(light + "\"rgb L\" [1 1 1]" + kShape, {"either L or filename"}, files);
    expect_error(light + kShape, {"a.tga"});
    const std::string black = "AreaLightSource \"diffuse\" \"string filename\" \"black.tga\" ";
    EXPECT_TRUE(world(black + kShape, files).emissions.empty());
    expect_error(black + "\"float power\" 10" + kShape, {"scene.pbrt:3", "black"}, files);
    expect_warning(light + "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"string emissionfilename\" \"a.tga\"",
                   "emissionfilename", files);
}

/// pi times radiance times area over the triangles of all meshes from `first` on; also that they have one radiance.
double power_of(const SceneDescription& d, bool* even) {
    double power = 0;
    float least = INFINITY, most = 0;
    for (const TriangleMesh& mesh : d.meshes) {
        const float radiance = d.emissions.at(size_t(mesh.attributes.emission)).radiance.g;
        least = std::fmin(least, radiance);
        most = std::fmax(most, radiance);
        for (size_t i = 0; i < mesh.indices.size(); i += 3) {
            const Vec3& a = mesh.positions[mesh.indices[i]];
            const Vec3 u = mesh.positions[mesh.indices[i + 1]] - a, v = mesh.positions[mesh.indices[i + 2]] - a;
            power += 3.14159265 * double(radiance) * 0.5 * double(length(cross(u, v)));
        }
    }
    *even = most - least <= 1e-6f * most;
    return power;
}

TEST(ImportLight, PowerIsThatOfTheWholeShape) {
    const std::string light = "AreaLightSource \"diffuse\" \"float power\" 10 ";
    const std::string square = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0";
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 3\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n4 3 0\n0 1 0\n9 0 0\n9 9 0\n";
    struct Case {
        std::string shape;
        double shapes;
        bool even;
    };
    for (const Case& c :
         {Case{"Shape \"disk\" \"float radius\" 3", 1, true},
          Case{"Shape \"disk\" \"float radius\" 3 \"float innerradius\" 1", 1, true}, Case{"Scale 1 2 3 Shape \"sphere\"", 1, true},
          Case{square + "]", 1, true}, Case{"Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 1 1 1]", 1, true},
          Case{square + " 9 9 0 9 9 5] \"integer indices\" [0 1 2 3 1 3 4 5]", 2, false},
          Case{"Shape \"plymesh\" \"string filename\" \"a.ply\"", 3, false}}) {
        bool even = false;
        const SceneDescription d = world(light + c.shape, {{"a.ply", header + "3 0 1 3\n4 0 1 2 3\n3 1 4 5\n"}});
        EXPECT_NEAR(power_of(d, &even) / (10 * c.shapes), 1, 1e-5) << c.shape;
        EXPECT_EQ(even, c.even) << c.shape;
    }
    // A two-sided one sends half of its power to either side.
    bool even = false;
    const SceneDescription d = world("AreaLightSource \"diffuse\" \"float power\" 10 \"bool twosided\" true Shape \"disk\"");
    EXPECT_NEAR(power_of(d, &even), 5, 1e-4);
    const SceneDescription two = world(light + square + " 9 9 0 9 9 5] \"integer indices\" [0 1 2 3 1 3 4 5]");
    EXPECT_NE(two.warnings.at(1).find("each of the 2 faces"), std::string::npos) << two.warnings.at(1);
}

/// pbrt-v4 divides the power by the area before the transformation, and warns of its scale.
TEST(ImportLight, PowerIsThatOfTheShapeAsItIsScaled) {
    const std::string light = "AreaLightSource \"diffuse\" \"float power\" 10 ";
    const auto radiance = [&](const std::string& text) { return double(world(text).emissions.at(0).radiance.g); };
    EXPECT_NEAR(radiance(light + "Scale 3 3 3" + kShape) * 9, radiance(light + kShape), 1e-5);
    EXPECT_NEAR(radiance(light + "Scale 3 3 3 Shape \"disk\"") * 9, radiance(light + "Shape \"disk\""), 1e-5);
    expect_warning(light + "Scale 3 3 3" + kShape, "as it is scaled");
    EXPECT_EQ(world(light + "Scale 3 3 3 Shape \"disk\"").warnings.size(), 2u);
    EXPECT_EQ(world(light + "Shape \"disk\"").warnings.size(), 1u);
    EXPECT_TRUE(world(light + "Rotate 30 1 2 3 Translate 1 2 3 Scale -1 1 1" + kShape).warnings.empty());
    EXPECT_TRUE(world("AreaLightSource \"diffuse\" Scale 3 3 3" + kShape).warnings.empty()) << "no power";
    EXPECT_TRUE(world(light + "Scale 3 3 3 Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]").warnings.empty());
}

TEST(ImportLight, KnowsItsLine) {
    const SceneDescription d = world(
        "\nLightSource \"point\"\nLightSource \"spot\"\nLightSource \"distant\"\n"
        "LightSource\n\"infinite\"\n\nLightSource \"infinite\"");
    EXPECT_EQ(d.point_lights.at(0).source, "scene.pbrt:4");
    EXPECT_EQ(d.spot_lights.at(0).source, "scene.pbrt:5");
    EXPECT_EQ(d.distant_lights.at(0).source, "scene.pbrt:6");
    EXPECT_EQ(d.infinite_lights.at(0).source, "scene.pbrt:7");
    EXPECT_EQ(d.infinite_lights.at(1).source, "scene.pbrt:10");
}

TEST(ImportLight, PositionsAreBounded) {
    for (const std::string kind : {"point", "spot"}) {
        const std::string light = "LightSource \"" + kind + "\" ";
        expect_error(light + "\"point3 from\" [1e19 0 0]", {"scene.pbrt:3", kind.c_str(), "1e15", "scale the scene"});
        expect_error("Translate 0 0 -1e16 " + light, {"scene.pbrt:3", "1e15"});
        EXPECT_TRUE(import_world(light + "\"point3 from\" [1e14 0 0]").ok());
    }
}

TEST(ImportLight, PointSpotAndDistant) {
    SceneDescription d = world("Translate 1 0 0 LightSource \"point\" \"rgb I\" [1 2 3] \"point3 from\" [0 1 0] \"float power\" 8");
    EXPECT_EQ(d.point_lights.at(0).position, (Vec3{1, 1, 0}));
    EXPECT_NEAR(d.point_lights[0].intensity.g, 2 * 8 / (4 * 3.14159265), 1e-5);
    d = world(
        "LightSource \"spot\" \"point3 from\" [0 0 5] \"point3 to\" [0 0 0] \"float coneangle\" 60 \"float "
        "conedeltaangle\" 60");
    EXPECT_EQ(d.spot_lights.at(0).axes.n, (Vec3{0, 0, -1}));
    EXPECT_NEAR(d.spot_lights[0].total_height, 0.5, 1e-6);
    EXPECT_NEAR(d.spot_lights[0].falloff_height, 0, 1e-6);
    EXPECT_EQ(d.spot_lights[0].intensity, Rgb(1.0f));
    d = world("LightSource \"spot\" \"float coneangle\" 60 \"float conedeltaangle\" 60 \"float power\" 2");
    EXPECT_NEAR(d.spot_lights.at(0).intensity.r, 2 / (2 * 3.14159265 * 0.25), 1e-5);
    d = world("Rotate 90 1 0 0 LightSource \"distant\" \"float illuminance\" 3 \"rgb L\" [1 1 2]");
    EXPECT_NEAR(d.distant_lights.at(0).direction.y, -1, 1e-6);
    EXPECT_EQ(d.distant_lights[0].irradiance, Rgb(3, 3, 6));
    expect_error("LightSource \"distant\" \"point3 from\" [1 1 1] \"point3 to\" [1 1 1]", {"same point"});
    expect_error("Scale 1 2 1 LightSource \"spot\"", {"similarity"});
    d = world("LightSource \"spot\" \"float coneangle\" 0.01 \"float conedeltaangle\" 0");
    EXPECT_NEAR(d.spot_lights.at(0).total_height / 1.5230871e-8, 1, 1e-6);
    expect_error("LightSource \"spot\" \"float coneangle\" 0.009 \"float conedeltaangle\" 0", {"coneangle", "0.01"});
    expect_error("LightSource \"goniometric\"", {"goniometric"});
    expect_error("LightSource \"point\" \"rgb L\" [1 1 1]", {"unknown parameter"});
    expect_error("LightSource \"point\" \"float scale\" -1", {"negative"});
}

TEST(ImportLight, Infinite) {
    SceneDescription d = world("Rotate 90 0 0 1 LightSource \"infinite\" \"rgb L\" [1 2 3] \"float illuminance\" 5");
    EXPECT_NEAR(d.infinite_lights.at(0).radiance.b, 3 * 5 / 3.14159265, 1e-5);
    EXPECT_NEAR(d.infinite_lights[0].light_to_world.m[1][0], 1, 1e-9);
    const testing::FileMap files{{"e.tga", tga(2, 2, std::string(12, '\xff'))}, {"wide.tga", tga(2, 1, "abcdef")}};
    d = world("LightSource \"infinite\" \"string filename\" \"e.tga\" \"float scale\" 3", files);
    EXPECT_EQ(d.infinite_lights.at(0).radiance, Rgb(3.0f));
    EXPECT_EQ(d.images.at(size_t(d.infinite_lights[0].image)).width, 2);
    expect_error("LightSource \"infinite\" \"string filename\" \"wide.tga\"", {"square"}, files);
    expect_error("LightSource \"infinite\" \"string filename\" \"e.tga\" \"rgb L\" [1 1 1]", {"not both"}, files);
    // pbrt-v4 weighs the channels of an EXR in the order of the file, so that this blue map counts as red.
    constexpr std::array<float, 8> kRec709{0.64f, 0.33f, 0.3f, 0.6f, 0.15f, 0.06f, 0.3127f, 0.329f};
    const auto radiance_of = [&](const Rgb& map) {
        const std::string light = "LightSource \"infinite\" \"string filename\" \"e.exr\" \"float illuminance\" 1";
        return world(light, {{"e.exr", exr(map, kRec709)}}).infinite_lights.at(0).radiance.r;
    };
    EXPECT_NEAR(radiance_of(Rgb(1.0f)) / radiance_of({0, 0, 1}), Rgb(1, 0, 0).luminance(), 1e-5);
    constexpr std::array<float, 8> kRec2020{0.708f, 0.292f, 0.17f, 0.797f, 0.131f, 0.046f, 0.3127f, 0.329f};
    const Rgb wide = world("LightSource \"infinite\" \"string filename\" \"e.EXR\" \"float illuminance\" 1",
                           {{"e.EXR", exr({0.1f, 0.1f, 1}, kRec2020)}})
                         .infinite_lights.at(0)
                         .radiance;
    EXPECT_NEAR(radiance_of(Rgb(1.0f)) / wide.r, 0.1 + 0.9 * 0.2627, 1e-4) << "by the file's own primaries";
    expect_warning("LightSource \"infinite\" \"string filename\" \"e.exr\"", "negative", {{"e.exr", exr({-1e-6f, 1, 1}, kRec709)}});
    expect_error("LightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]", {"portal"});
}

TEST(ImportSpectra, Reductions) {
    // White light is white, whatever names it.
    bool clipped = false;
    const Rgb d65 = *import::named_illuminant_rgb("stdillum-D65", &clipped);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(d65[c], 1, 1e-3);
    const Rgb warm = import::blackbody_rgb(2856, &clipped), a = *import::named_illuminant_rgb("stdillum-A", &clipped);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(warm[c], a[c], 0.01);
    EXPECT_FALSE(clipped);
    for (const double kelvin : {150.0, 1000.0, 6500.0, 1e6})
        EXPECT_NEAR(import::blackbody_rgb(kelvin, &clipped).luminance(), 1, 1e-3) << kelvin;
    EXPECT_TRUE(clipped);
    const import::Spectrum flat{{300, 0.4}, {900, 0.4}};
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(import::reflectance_rgb(flat)[c], 0.4, 1e-6);
    Rgb white;
    for (int nm = 380; nm <= 780; ++nm) white += import::d65_rgb_at(nm);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 1, 1e-5);
    EXPECT_NEAR(import::illuminant_rgb(flat, &clipped)->luminance(), 1, 1e-3);
    // A conductor's colour at normal incidence is that of its spectral reflectance.
    const import::ConductorRgb constant = import::conductor_rgb({{300, 0.3}, {900, 0.3}}, {{300, 2.5}, {900, 2.5}});
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(constant.eta[c], 0.3, 1e-6);
        EXPECT_NEAR(constant.k[c], 2.5, 1e-4);
    }
    // A channel that the spectrum's colour has above 1, as gold has, is reflected whole.
    const import::ConductorRgb red = import::conductor_rgb({{300, 0.3}, {900, 0.3}}, {{300, 1}, {570, 1}, {571, 90}, {900, 90}});
    const double n = red.eta.r, k = red.k.r;
    EXPECT_NEAR(((n - 1) * (n - 1) + k * k) / ((n + 1) * (n + 1) + k * k), 0.9999, 1e-5);
    EXPECT_FALSE(import::spectrum_from_pairs({400, 1, 400, 2}).has_value());
    EXPECT_FALSE(import::spectrum_from_pairs({400, 1, 500}).has_value());
}

TEST(ImportSpectra, InScenes) {
    SceneDescription d = world("LightSource \"point\" \"blackbody I\" 3000 \"float scale\" 4");
    EXPECT_NEAR(d.point_lights.at(0).intensity.luminance(), 4, 0.01);
    EXPECT_GT(d.point_lights[0].intensity.r, d.point_lights[0].intensity.b);
    d = world("Material \"diffuse\" \"spectrum reflectance\" \"r.spd\"" + kShape, {{"r.spd", "# grey\n300 0.25\n900 0.25\n"}});
    EXPECT_NEAR(value(d, material_of(d).reflectance).g, 0.25, 1e-6);
    d = world("Material \"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), import::named_metal("metal-Au")->eta);
    d = world("Material \"conductor\" \"spectrum eta\" [300 0.2 900 0.2] \"spectrum k\" [300 3 900 3]" + kShape);
    EXPECT_NEAR(value(d, material_of(d).k).r, 3, 1e-3);
    expect_warning("LightSource \"point\" \"blackbody I\" 500", "gamut");
    expect_error("LightSource \"point\" \"spectrum I\" \"stdillum-Z\"", {"stdillum-Z"});
    struct Case {
        std::string directive, parameter, name;
    };
    for (const Case& c : {Case{"Material \"dielectric\"", "eta", "glass-XYZ"}, Case{"LightSource \"point\"", "I", "stdillum-F13"},
                          Case{"Material \"diffuse\"", "reflectance", "foo"}, Case{"Material \"conductor\"", "eta", "metal-Xx-eta"},
                          Case{"Material \"conductor\"", "k", "metal-Xx-k"}, Case{"AreaLightSource \"diffuse\"", "L", "foo"},
                          Case{"Texture \"t\" \"spectrum\" \"constant\"", "value", "foo"}})
        expect_error(c.directive + "\n\"spectrum " + c.parameter + "\" \"" + c.name + "\"" + kShape,
                     {"scene.pbrt:4: ", ("\"spectrum " + c.parameter + "\" is \"" + c.name + "\"").c_str(),
                      "neither a spectrum known by name nor a file"});
    // Known, but not as this.
    for (const std::string name : {"stdillum-A", "illum-acesD60"})
        expect_error("Material \"diffuse\" \"spectrum reflectance\" \"" + name + "\"", {name.c_str(), "known by name but not"});
    expect_error("Material \"dielectric\" \"spectrum eta\" \"metal-Ag-eta\"", {"metal-Ag-eta", "known by name but not"});
    expect_error("Material \"diffuse\" \"spectrum reflectance\" \"../r.spd\"", {"spectrum reflectance", "leaves"});
    expect_error("LightSource \"point\" \"blackbody I\" -3", {"kelvin"});
    expect_error("Material \"diffuse\" \"blackbody reflectance\" -3", {"scene.pbrt:3", "kelvin"});
    expect_error("Material \"diffuse\" \"spectrum reflectance\" [400 1 300 1]", {"increasing"});
    expect_error("Material \"diffuse\" \"spectrum reflectance\" \"r.spd\"", {"not a spectrum"}, {{"r.spd", "400 one"}});
    expect_error("LightSource \"point\" \"spectrum I\" [100 1 200 1]", {"luminance"});
}

/// Anything but a light takes a black body relative to its peak.
TEST(ImportSpectra, BlackBodiesAsReflectances) {
    const import::Spectrum warm = import::blackbody_spectrum(5000);
    EXPECT_NEAR(import::evaluate(warm, 2.8977720e6 / 5000), 1, 1e-5) << "Wien's displacement law";
    // Planck's law at 450 nm over its peak at 579.55 nm.
    const double x = 1.4387769e7 / (450 * 5000.0), peak = 1.4387769e7 / 2.8977720e6;
    EXPECT_NEAR(import::evaluate(warm, 450), std::pow(579.5544 / 450, 5) * std::expm1(peak) / std::expm1(x), 1e-5);
    const auto reflectance = [](const std::string& material) {
        const SceneDescription d = world(material + kShape);
        return value(d, material_of(d).reflectance);
    };
    const Rgb expected = import::reflectance_rgb(warm);
    EXPECT_GT(expected.r, expected.b);
    EXPECT_EQ(reflectance("Material \"diffuse\" \"blackbody reflectance\" 5000"), expected);
    EXPECT_EQ(reflectance("Material \"coateddiffuse\" \"blackbody reflectance\" 5000"), expected);
    EXPECT_EQ(reflectance("Attribute \"material\" \"blackbody reflectance\" 5000 Material \"diffuse\""), expected);
    EXPECT_EQ(reflectance("Texture \"b\" \"spectrum\" \"constant\" \"blackbody value\" 5000 "
                          "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"b\" \"blackbody tex2\" 5000 "
                          "Material \"diffuse\" \"texture reflectance\" \"t\""),
              expected);
    // Their peak lies in the infrared.
    EXPECT_LT(reflectance("Material \"diffuse\" \"blackbody reflectance\" 1500").max_component(), 0.1f);
    const SceneDescription d = world("Material \"conductor\" \"blackbody eta\" 5000 \"rgb k\" [2 2 2]" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), import::index_rgb(warm));
    expect_error("Material \"conductor\" \"rgb reflectance\" [1 1 1] \"blackbody k\" 5000", {"not both"});
}

TEST(ImportSpectra, NamedIndicesInTexturesAndAsReflectances) {
    const std::string silver = "Texture \"n\" \"spectrum\" \"constant\" \"spectrum value\" \"metal-Ag-eta\" ";
    SceneDescription d = world(silver + "Material \"conductor\" \"texture eta\" \"n\" \"spectrum k\" \"metal-Ag-k\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), import::named_metal("metal-Ag")->eta);
    EXPECT_EQ(value(d, material_of(d).k), import::named_metal("metal-Ag")->k);
    d = world("Material \"conductor\" \"spectrum eta\" \"glass-BK7\" \"spectrum k\" [300 2 900 2]" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), Rgb(1.5168f));
    EXPECT_NEAR(value(d, material_of(d).k).g, 2, 1e-5);
    d = world("Material \"diffuse\" \"spectrum reflectance\" \"metal-Ag-eta\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).reflectance), import::named_metal("metal-Ag")->eta);
    expect_warning("Material \"diffuse\" \"spectrum reflectance\" \"metal-Ag-eta\"", "per colour channel");
    // Numbers with commas between them, as spreadsheets write them.
    d = world("Material \"diffuse\" \"spectrum reflectance\" \"r.csv\"" + kShape, {{"r.csv", "300,0.25\n900, 0.25\n"}});
    EXPECT_NEAR(value(d, material_of(d).reflectance).g, 0.25, 1e-6);
}

}  // namespace
}  // namespace lightloom
