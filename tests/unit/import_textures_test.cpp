// Textures, and the image files that they read.

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "import_looks.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::exr;
using testing::kShape;
using testing::material_of;
using testing::png;
using testing::tga;
using testing::value;
using testing::world;

TEST(ImportTexture, KindsAndNesting) {
    const SceneDescription d = world(
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0] \"float uscale\" 2 "
        "\"float vscale\" 2\n"
        "Texture \"h\" \"float\" \"constant\" \"float value\" 0.5\n"
        "Texture \"s\" \"spectrum\" \"scale\" \"texture tex\" \"c\" \"texture scale\" \"h\"\n"
        "Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"s\" \"rgb tex2\" [0 0 1] \"float amount\" 0.25\n"
        "Material \"diffuse\" \"texture reflectance\" \"m\" Shape \"sphere\" \"texture alpha\" \"h\"");
    const TextureId id = material_of(d).reflectance;
    EXPECT_EQ(value(d, id, {0.1f, 0.1f}), Rgb(0.375f, 0, 0.25f));
    EXPECT_EQ(value(d, id, {0.6f, 0.1f}), Rgb(0, 0.375f, 0.25f));
    EXPECT_EQ(value(d, id, {-0.1f, 0.1f}), Rgb(0, 0.375f, 0.25f));
    EXPECT_EQ(value(d, d.spheres[0].attributes.alpha), Rgb(0.5f));
}

TEST(ImportTexture, ImagesAreLookedUpAsInPbrt) {
    // Bottom row: red, green; top row: blue, white.
    const testing::FileMap files{{"t.tga", tga(2, 2,
                                               std::string("\0\0\xff"
                                                           "\0\xff\0"
                                                           "\xff\0\0"
                                                           "\xff\xff\xff",
                                                           12))}};
    const auto look = [&](const std::string& options, Vec2 uv) {
        const SceneDescription d = world("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.tga\" " + options +
                                             " Material \"diffuse\" \"texture reflectance\" \"t\"" + kShape,
                                         files);
        return value(d, material_of(d).reflectance, uv);
    };
    const std::string point = "\"string filter\" \"point\" ";
    EXPECT_EQ(look(point, {0.25f, 0.25f}), Rgb(1, 0, 0));
    EXPECT_EQ(look(point, {0.75f, 0.25f}), Rgb(0, 1, 0));
    EXPECT_EQ(look(point, {0.25f, 0.75f}), Rgb(0, 0, 1));
    EXPECT_EQ(look(point, {1.25f, -0.75f}), Rgb(1, 0, 0));
    EXPECT_EQ(look(point + "\"string wrap\" \"black\"", {1.25f, 0.25f}), Rgb(0, 0, 0));
    EXPECT_EQ(look(point + "\"string wrap\" \"clamp\"", {5, 0.25f}), Rgb(0, 1, 0));
    EXPECT_EQ(look(point + "\"bool invert\" true \"float scale\" 0.5", {0.25f, 0.25f}), Rgb(0.5f, 1, 1));
    EXPECT_EQ(look("\"string wrap\" \"clamp\"", {0.5f, 0.25f}), Rgb(0.5f, 0.5f, 0));
    EXPECT_EQ(look("", {0.5f, 0.5f}), Rgb(0.5f, 0.5f, 0.5f));
}

TEST(ImportTexture, EncodingsAndFloats) {
    const testing::FileMap files{{"g.png", png(1, 1, 0, std::string("\0\x80", 2))},
                                 {"c.png", png(1, 1, 2, std::string("\0\x30\x60\x90", 4))}};
    const auto grey = [&](const std::string& options) {
        const SceneDescription d = world("Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"g.png\" " + options +
                                             " Shape \"sphere\" \"texture alpha\" \"t\"",
                                         files);
        return value(d, d.spheres.at(0).attributes.alpha).g;
    };
    EXPECT_NEAR(grey(""), 0.21586, 1e-4);
    EXPECT_NEAR(grey("\"string encoding\" \"linear\""), 128 / 255.0, 1e-6);
    EXPECT_NEAR(grey("\"string encoding\" \"gamma 2.2\""), std::pow(128 / 255.0, 2.2), 1e-5);
    const SceneDescription d = world(
        "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"c.png\" \"string encoding\" \"linear\""
        " Shape \"sphere\" \"texture alpha\" \"t\"",
        files);
    EXPECT_NEAR(value(d, d.spheres[0].attributes.alpha).r, 96 / 255.0, 1e-6);
    expect_warning("Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"g.tga\" \"string encoding\" \"linear\"", "sRGB",
                   {{"g.tga", tga(1, 1, "\x80\x80\x80")}});
    const SceneDescription fixed = world(
        "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"g.tga\" \"string encoding\" \"linear\""
        " Shape \"sphere\" \"texture alpha\" \"t\"",
        {{"g.tga", tga(1, 1, "\x80\x80\x80")}});
    EXPECT_NEAR(value(fixed, fixed.spheres[0].attributes.alpha).r, 0.21586, 1e-4) << "as in pbrt, whatever the file asks for";
}

/// pbrt-v4 knows the alpha of an RGBA PNG; what the decoder makes of a palette's transparency or finds in a TGA is dropped.
TEST(ImportTexture, AlphaIsThatOfRgbaFilesAlone) {
    const auto alpha = [&](const std::string& name, const std::string& bytes) {
        const SceneDescription d = world(
            "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"" + name + "\" Shape \"sphere\" \"texture alpha\" \"t\"",
            {{name, bytes}});
        return value(d, d.spheres.at(0).attributes.alpha).r;
    };
    EXPECT_NEAR(alpha("a.png", png(1, 1, 6, std::string("\0\xff\xff\xff\x80", 5))), 0.21586, 1e-4);
    EXPECT_EQ(alpha("a.png", png(1, 1, 3, std::string("\0\0", 2), "\xff\xff\xff", "\x40")), 1);
    EXPECT_EQ(alpha("a.png", png(1, 1, 2, std::string("\0\xff\xff\xff", 4), "", std::string("\0\xff\0\xff\0\xff", 6))), 1);
    std::string rgba = tga(1, 1, "\xff\xff\xff\x40");
    rgba[16] = 32;
    rgba[17] = 8;
    EXPECT_EQ(alpha("a.tga", rgba), 1);
}

TEST(ImportTexture, PrimariesOfExrFilesBecomeThoseOfSrgb) {
    constexpr std::array<float, 8> kRec709{0.64f, 0.33f, 0.3f, 0.6f, 0.15f, 0.06f, 0.3127f, 0.329f};
    constexpr std::array<float, 8> kRec2020{0.708f, 0.292f, 0.17f, 0.797f, 0.131f, 0.046f, 0.3127f, 0.329f};
    constexpr std::array<float, 8> kAces{0.7347f, 0.2653f, 0, 1, 0.0001f, -0.077f, 0.32168f, 0.33767f};
    const std::string texture = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"c.exr\" ";
    const auto colour = [&](const Rgb& c, const std::array<float, 8>& xy) {
        const SceneDescription d =
            world(texture + "Material \"diffuse\" \"texture reflectance\" \"t\"" + kShape, {{"c.exr", exr(c, xy)}});
        return value(d, material_of(d).reflectance);
    };
    const Rgb kept = colour({0.9f, 0.5f, 0.1f}, kRec709);
    EXPECT_FLOAT_EQ(kept.r, 0.9f);
    EXPECT_FLOAT_EQ(kept.b, 0.1f);
    const Rgb white = colour(Rgb(0.5f), kRec2020), red = colour({0.5f, 0.1f, 0.1f}, kRec2020);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 0.5, 1e-6);
    EXPECT_NEAR(red.r, 0.7642, 1e-4);
    EXPECT_NEAR(red.g, 0.0502, 1e-4);
    EXPECT_EQ(colour({0.5f, 0, 0}, kRec2020).g, 0) << "outside of sRGB";
    EXPECT_NEAR(colour({0.5f, 0, 0}, kRec2020).luminance(), 0.5 * 0.2627, 1e-4);
    expect_warning(texture, "gamut", {{"c.exr", exr({0.5f, 0, 0}, kRec2020)}});
    expect_warning(texture, "negative", {{"c.exr", exr({0.5f, 0.5f, -0.1f}, kRec709)}});
    expect_error(texture, {"c.exr", "chromaticities"}, {{"c.exr", exr(Rgb(0.5f), kAces)}});
}

/// A PFM of `floats` in the order of the file: rows from the bottom.
std::string pfm(const std::string& header, const std::vector<float>& floats, bool little_endian) {
    std::string out = header;
    for (const float v : floats) {
        const uint32_t code = std::bit_cast<uint32_t>(v);
        for (int i = 0; i < 4; ++i) out += char(code >> 8 * (little_endian ? i : 3 - i));
    }
    return out;
}

TEST(ImportTexture, PortableFloatMaps) {
    const std::vector<float> colours{1, 0, 0, 0, 0.5f, 0, 0, 0, 0.25f, 0.75f, 0.75f, 0.75f};
    const auto look = [](const std::string& bytes, Vec2 uv) {
        const SceneDescription d = world(
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.PFM\" \"string filter\" \"point\" "
            "Material \"diffuse\" \"texture reflectance\" \"t\"" +
                kShape,
            {{"a.PFM", bytes}});
        EXPECT_TRUE(d.warnings.empty());
        return value(d, material_of(d).reflectance, uv);
    };
    const std::string little = pfm("PF\n2 2\n-1.0\n", colours, true);
    for (const std::string& bytes : {little, pfm("PF\n2 2\n1.0\n", colours, false), pfm("PF\r\n2 2\r\n-1\r\n", colours, true),
                                     pfm("PF # by hand\n# 2 pixels\n 2\t2\n  -1e0 ", colours, true)}) {
        EXPECT_EQ(look(bytes, {0.25f, 0.25f}), Rgb(1, 0, 0));
        EXPECT_EQ(look(bytes, {0.75f, 0.25f}), Rgb(0, 0.5f, 0));
        EXPECT_EQ(look(bytes, {0.25f, 0.75f}), Rgb(0, 0, 0.25f));
        EXPECT_EQ(look(bytes, {0.75f, 0.75f}), Rgb(0.75f));
    }
    EXPECT_EQ(look(pfm("PF 2 2 -0.5 ", colours, true), {0.25f, 0.25f}), Rgb(0.5f, 0, 0)) << "the scale multiplies, as in pbrt";
    EXPECT_EQ(look(pfm("Pf 1 2 1 ", {0.25f, 0.5f}, false), {0.5f, 0.75f}), Rgb(0.5f));
    // The first pixel begins with the byte of a line feed.
    EXPECT_EQ(look(pfm("Pf 1 1 -1\r", {std::bit_cast<float>(0x3f00000au)}, true), {0.5f, 0.5f}).r,
              std::bit_cast<float>(0x3f00000au));

    const std::string floats = "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"a.pfm\" ";
    const SceneDescription grey =
        world(floats + "Shape \"sphere\" \"texture alpha\" \"t\"", {{"a.pfm", pfm("PF 1 1 -1\n", {0.25f, 0.5f, 0.75f}, true)}});
    EXPECT_FLOAT_EQ(value(grey, grey.spheres[0].attributes.alpha).r, 0.5f);
    const SceneDescription sky = world("LightSource \"infinite\" \"string filename\" \"a.pfm\"", {{"a.pfm", little}});
    EXPECT_EQ(sky.images.at(0).texel(0, 1), Rgb(1, 0, 0));

    const auto refused = [&](const std::string& bytes, std::initializer_list<const char*> parts) {
        expect_error(floats, parts, {{"a.pfm", bytes}});
    };
    refused("", {"scene.pbrt:3", "a.pfm", "PF or Pf"});
    refused("P6 1 1 255\n123", {"PF or Pf"});
    refused("PF 1 x -1\n", {"\"x\"", "height"});
    refused("PF -1 1 -1\n", {"\"-1\"", "width"});
    refused("PF 1 1\n", {"scale"});
    refused(pfm("PF 1 1 0\n", {1, 1, 1}, true), {"\"0\"", "scale"});
    refused(little.substr(0, little.size() - 1), {"cut short", "48 bytes", "47 are there"});
    refused("PF 9999 9999 -1\n", {"9999 x 9999", "cannot hold"});
    refused(pfm("Pf 1 1 -1\n", {std::numeric_limits<float>::infinity()}, true), {"finite"});
    expect_warning(floats, "last 3 bytes", {{"a.pfm", pfm("Pf 1 1 -1\n", {1}, true) + "end"}});
    const std::string colour = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.pfm\" ";
    expect_warning(colour, "behind the pixels, are ignored; negative values", {{"a.pfm", pfm("Pf 1 1 -1\n", {-1}, true) + "end"}});
}

/// The same spectrum is reduced in one way as a reflectance and in another as an index.
TEST(ImportTexture, SpectraAreReducedByTheirUse) {
    const std::string green = "[400 0.05 499 0.05 500 0.9 560 0.9 561 0.05 700 0.05]";
    const SceneDescription direct = world("Material \"diffuse\" \"spectrum reflectance\" " + green + kShape);
    const Rgb expected = value(direct, material_of(direct).reflectance);
    const std::string texture = "Texture \"t\" \"spectrum\" \"constant\" \"spectrum value\" " + green +
                                " Texture \"half\" \"spectrum\" \"scale\" \"texture tex\" \"t\" \"float scale\" 0.5 ";
    SceneDescription d = world(texture + "Material \"diffuse\" \"texture reflectance\" \"t\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).reflectance), expected);
    d = world(texture + "Material \"diffuse\" \"texture reflectance\" \"half\"" + kShape);
    EXPECT_EQ(value(d, material_of(d).reflectance), expected * 0.5f);
    d = world(texture + "Material \"conductor\" \"texture eta\" \"t\" \"texture k\" \"t\"" + kShape);
    const SceneDescription index = world("Material \"conductor\" \"spectrum eta\" " + green + " \"rgb k\" [1 1 1]" + kShape);
    EXPECT_EQ(value(d, material_of(d).eta), value(index, material_of(index).eta));
    EXPECT_NE(value(d, material_of(d).eta), expected);
    // In per cent, as a texture's scale may have it.
    d = world(
        "Texture \"p\" \"spectrum\" \"constant\" \"spectrum value\" [300 80 900 80] "
        "Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"p\" \"float scale\" 0.01 "
        "Material \"diffuse\" \"texture reflectance\" \"t\"" +
        kShape);
    EXPECT_NEAR(value(d, material_of(d).reflectance).g, 0.8, 1e-5);
}

TEST(ImportTexture, Errors) {
    expect_error("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"no.png\"", {"scene.pbrt:3", "no.png"});
    expect_error("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"no.bmp\"", {"bmp", "png"}, {{"no.bmp", "BM"}});
    for (const char* name : {"a.png", "a.jpg", "a.hdr", "a.tga", "a.exr", "a.pfm"})
        expect_error(std::string("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"") + name + "\"", {name},
                     {{name, "rubbish"}});
    std::string huge = tga(1, 1, "");
    huge[12] = huge[13] = huge[14] = huge[15] = '\x3f';
    expect_error("Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.tga\"", {"cannot hold"}, {{"a.tga", huge}});
    expect_error("Texture \"t\" \"spectrum\" \"ptex\"", {"ptex", "not supported"});
    expect_error("Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"t\"", {"itself"});
    expect_error("Texture \"t\" \"colour\" \"constant\"", {"float or spectrum"});
    expect_error("Texture \"t\" \"float\" \"constant\" Texture \"t\" \"float\" \"constant\"", {"twice"});
    expect_error("Texture \"t\" \"float\" \"constant\" Material \"diffuse\" \"texture reflectance\" \"t\"", {"other type"});
    expect_warning("Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"t.tga\" \"string filter\" \"trilinear\"", "bilinear",
                   {{"t.tga", tga(1, 1, "abc")}});
    std::string chain = "Texture \"t0\" \"float\" \"checkerboard\"", wide = chain;
    for (int i = 1; i < 40; ++i) {
        const std::string name = "\"t" + std::to_string(i) + "\"", previous = "\"t" + std::to_string(i - 1) + "\"";
        chain += " Shape \"sphere\" \"texture alpha\" " + previous + " Texture " + name + " \"float\" \"scale\" \"texture tex\" " +
                 previous;
        if (i < 20)
            wide += " Texture " + name + " \"float\" \"scale\" \"texture tex\" " + previous + " \"texture scale\" " + previous;
    }
    expect_error(chain, {"31 levels"});
    expect_error(wide, {"4096"});
}

}  // namespace
}  // namespace lightloom
