// Files as they are found: meshes as other programs write them, other formats, images that compress well, places of files.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <half.h>
#include <zlib.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "common/film/exr_memory.h"
#include "common/import/exr_image.h"
#include "common/import/foreign.h"
#include "common/import/ply.h"
#include "import_testing.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::FileMap;
using testing::import_text;
using testing::import_world;
using testing::world;

const char kTriangle[] = "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";

// --------------------------------------------------------------------------------------------------------------- PLY

const char kVertices[] = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

/// A square with the given lines for its faces in the header and in the data.
std::string square(const std::string& faces, const std::string& data) {
    return "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n" + faces +
           "end_header\n" + kVertices + data;
}

const char kFaces[] = "element face 1\nproperty list uchar int vertex_indices\n";

std::string with_line_ends(const std::string& text, const std::string& line_end, const std::string& before = "") {
    std::string out;
    for (const char c : text) out += c == '\n' ? before + line_end : std::string(1, c);
    return out;
}

std::vector<uint32_t> indices_of(const std::string& ply) {
    const auto mesh = import::read_ply(ply);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message() << "\n" << ply;
    return mesh.ok() ? mesh->indices : std::vector<uint32_t>();
}

const std::vector<uint32_t> kTwo{0, 1, 2, 0, 2, 3};

TEST(PlyOfOthers, HeadersAreReadLoosely) {
    const std::string plain = square(kFaces, "4 0 1 2 3\n");
    EXPECT_EQ(indices_of(plain), kTwo);
    for (const char* line_end : {"\n", "\r\n", "\r"})
        for (const char* before : {"", " ", "\t", " \t "}) EXPECT_EQ(indices_of(with_line_ends(plain, line_end, before)), kTwo);
    std::string notes;
    for (int i = 0; i < 300; ++i) notes += "comment c\nobj_info element vertex 9\n";
    EXPECT_EQ(indices_of(square(notes + kFaces + notes, "4 0 1 2 3\ntrailing words")), kTwo);
    EXPECT_EQ(indices_of(square(kFaces, "\n\n 4\t0 1 2\n3 ")), kTwo);
    EXPECT_EQ(indices_of(square("element face 1\nproperty list int8 float64 vertex_index\n", "+4 0 +1 2.0 3e0\n")), kTwo);
    for (const char* type :
         {"char", "int8", "uchar", "uint8", "short", "int16", "ushort", "uint16", "int", "int32", "uint", "uint32"})
        EXPECT_EQ(indices_of(square(std::string("element face 1\nproperty list ") + type + " " + type + " vertex_indices\n",
                                    "4 0 1 2 3\n")),
                  kTwo);
}

TEST(PlyOfOthers, WhatNothingUsesIsSkipped) {
    EXPECT_EQ(indices_of("ply\nformat ascii 1.0\nelement camera 1\nproperty float fov\nproperty list uint8 double b\n"
                         "element vertex 4\nproperty float x\nproperty list uchar int neighbours\nproperty float y\n"
                         "property float z\nproperty uchar red\nelement nothing 7\nelement face 1\nproperty int flags\n"
                         "property list uchar int vertex_indices\nproperty list uchar float texcoord\nelement edge 1\n"
                         "property int vertex1\nend_header\n"
                         "45 2 1 1\n0 0 0 0 9\n1 2 5 6 0 0 9\n1 1 7 1 0 9\n0 0 1 0 9\n77 4 0 1 2 3 2 0.5 0.5\n3\n"),
              kTwo);
}

TEST(PlyOfOthers, ElementsComeInAnyOrder) {
    const std::string faces_first =
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 4\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n4 0 1 2 3\n";
    EXPECT_EQ(indices_of(faces_first + kVertices), kTwo);
    const std::string out_of_range = faces_first.substr(0, faces_first.size() - 2) + "4\n";
    EXPECT_FALSE(import::read_ply(out_of_range + kVertices).ok());
}

TEST(PlyOfOthers, FacesWithoutAreaAreLeftOutWithOneWarning) {
    const std::string text =
        square("element face 5\nproperty list uchar int vertex_indices\n", "2 0 1\n4 0 1 2 3\n0\n1 9\n3 1 2 3\n");
    const auto mesh = import::read_ply(text);
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3, 1, 2, 3}));
    EXPECT_EQ(mesh->faces, (std::vector<uint32_t>{0, 0, 1}));
    EXPECT_EQ(mesh->skipped_faces, 3u);
    expect_warning("Shape \"plymesh\" \"string filename\" \"a.ply\"", "3 faces of fewer than three", {{"a.ply", text}});
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\"", {"a.ply", "three or more"},
                 {{"a.ply", square(kFaces, "2 0 1\n")}});
}

TEST(PlyOfOthers, StripsAreTriangles) {
    const std::string header = "element tristrips 1\nproperty list int int vertex_indices\n";
    EXPECT_EQ(indices_of(square(header, "5 0 1 3 2 -1\n")), (std::vector<uint32_t>{0, 1, 3, 3, 1, 2}));
    EXPECT_EQ(indices_of(square(header, "8 0 1 3 -1 1 2 3 -1\n")), (std::vector<uint32_t>{0, 1, 3, 1, 2, 3}));
    EXPECT_FALSE(import::read_ply(square(header, "4 0 1 3 4\n")).ok());
    EXPECT_FALSE(import::read_ply(square(header, "2 0 1\n")).ok());
}

/// pbrt takes the first pair that it knows; a file may have several.
TEST(PlyOfOthers, OneOfSeveralPairsOfTextureCoordinates) {
    const std::string text =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float s\n"
        "property float t\nproperty float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 7 7 1 2\n1 0 0 7 7 3 4\n1 1 1e-400 7 7 5 6\n3 0 1 2\n";
    const auto mesh = import::read_ply(text);
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_EQ(mesh->uvs.at(1).x, 3);
    EXPECT_EQ(mesh->ignored_properties.size(), 2u);
}

TEST(PlyOfOthers, ReasonsAreSaid) {
    const auto refused = [](const std::string& bytes, const char* part) {
        const auto mesh = import::read_ply(bytes);
        ASSERT_FALSE(mesh.ok()) << bytes;
        EXPECT_NE(mesh.status().message().find(part), std::string::npos) << mesh.status().message();
    };
    refused(square("element face 1\nproperty list uchar int64 vertex_indices\n", "4 0 1 2 3\n"), "int64");
    refused(square("element face 1\nproperty list float int vertex_indices\n", "4 0 1 2 3\n"), "float");
    refused(square("element face 1\nproperty list char int vertex_indices\n", "-4 0 1 2 3\n"), "negative");
    refused(square("", ""), "no faces");
    refused(square("element face 0\nproperty list uchar int vertex_indices\n", ""), "no faces");
    refused(square("element face 1\nproperty int vertex_indices\n", "4\n"), "vertex_indices list");
    refused(square(std::string(kFaces) + "property float vertex_indices\n", "4 0 1 2 3\n"), "twice");
    refused(square(kFaces, "4 0 1 2 4\n"), "does not exist");
    refused("PLY\nformat ascii 1.0\nend_header\n", "not a PLY");
}

// ------------------------------------------------------------------------------------------------------ other formats

std::string message_of(const std::string& text) {
    const auto scene = import_text(text);
    EXPECT_FALSE(scene.ok()) << text;
    return scene.status().message();
}

TEST(ForeignFile, IsNamedWithWhatToDo) {
    const auto named = [](const std::string& bytes, std::initializer_list<const char*> parts) {
        const std::string message = message_of(bytes);
        EXPECT_EQ(message.find('\n'), std::string::npos);
        for (const char* part : parts) EXPECT_NE(message.find(part), std::string::npos) << message;
    };
    named(R"({"scenes": [], "asset": {"version": "2.0"}})", {"scene.pbrt", "glTF", "convert"});
    named(std::string("glTF\2\0\0\0", 8), {"glTF", "GLB", "convert"});
    named("# made by\nmtllib a.mtl\nv 0 0 0\n", {"OBJ", "convert"});
    named("v 0 0 0\nf 1 2 3\n", {"OBJ"});
    named("#usda 1.0\ndef Xform \"a\" {}", {"USD", "Blender"});
    named(std::string("PXR-USDC\0\0", 10), {"USD"});
    named(std::string("PK\3\4\0\0", 6), {"ZIP"});
    EXPECT_NE(import::foreign_scene("a.USDZ", "PK\3\4")->find("USD"), std::string::npos);
    named("<?xml version=\"1.0\"?>\n<scene version=\"3.0.0\"/>", {"Mitsuba", "convert"});
    named("<scene version=\"3.0.0\"/>", {"Mitsuba"});
    named("<!DOCTYPE html><html>", {"HTML", "download"});
    named("BLENDER-v300", {"Blender", "export"});
    named("ply\nformat ascii 1.0\n", {"PLY", "plymesh"});
    named("\x89PNG\r\n\x1a\n", {"PNG", "texture"});
    named("\x76\x2f\x31\x01", {"OpenEXR"});
    named(std::string("\xff\xfe"
                      "F\0i\0",
                      6),
          {"UTF-16", "UTF-8"});
    named(std::string("Shape\0", 6), {"binary"});
    named("version https://git-lfs.github.com/spec/v1\noid sha256:0\n", {"Git LFS", "git lfs pull"});
    named("\x1f\x8b garbage", {"gzip"});
    expect_error("Include \"a.pbrt\"", {"a.pbrt: this is a Wavefront OBJ"}, {{"a.pbrt", "v 0 0 0"}});
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\"", {"scene.pbrt:3", "a.ply", "git lfs pull"},
                 {{"a.ply", "version https://git-lfs.github.com/spec/v1\n"}});
}

TEST(ForeignFile, OlderPbrtIsNamedWithItsUpgrade) {
    for (const char* text :
         {"Film \"image\" \"integer xresolution\" 8 WorldBegin", "SurfaceIntegrator \"path\" WorldBegin",
          "Sampler \"lowdiscrepancy\"", "Integrator \"directlighting\"", "Renderer \"sampler\"",
          "WorldBegin Material \"matte\" \"xyz Kd\" [1 1 1]", "WorldBegin Material \"diffuse\" \"rgb Kd\" [1 1 1]",
          "WorldBegin MakeNamedMaterial \"m\" \"string type\" \"uber\"",
          "WorldBegin LightSource \"infinite\" \"string mapname\" \"a.exr\"", "WorldBegin Texture \"a\" \"color\" \"constant\"",
          "WorldBegin Shape \"cone\"", "WorldBegin WorldEnd", "WorldBegin AreaLightSource \"area\""}) {
        const std::string message = message_of(text);
        EXPECT_NE(message.find("pbrt --upgrade"), std::string::npos) << message;
        EXPECT_EQ(message.rfind("scene.pbrt:1: ", 0), 0u) << message;
    }
    EXPECT_EQ(message_of("WorldBegin Shape \"sphere\" \"float radius\" -1").find("upgrade"), std::string::npos);
}

TEST(ForeignFile, MarksAndLineEndsOfOtherSystemsDoNotMatter) {
    EXPECT_TRUE(import_text("\xef\xbb\xbfWorldBegin\n").ok());
    const std::string text = std::string("# a comment\nPixelFilter \"box\"\nWorldBegin # another\n") + kTriangle;
    for (const char* line_end : {"\n", "\r\n", "\r"}) {
        const auto scene = import_text(with_line_ends(text, line_end));
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        ASSERT_EQ(scene->description.meshes.size(), 1u);
        EXPECT_EQ(scene->description.meshes[0].attributes.source, "scene.pbrt:4");
    }
}

// ------------------------------------------------------------------------------------------------------------- images

std::string png_chunk(const std::string& type, const std::string& data) {
    const auto big_endian = [](uint32_t v) { return std::string{char(v >> 24), char(v >> 16), char(v >> 8), char(v)}; };
    const std::string body = type + data;
    return big_endian(uint32_t(data.size())) + body +
           big_endian(uint32_t(crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size()))));
}

/// All pixels are of the first code, in a palette of one colour for colour type 3.
std::string flat_png(int side, int bits, int colour_type) {
    const int samples = colour_type == 2 ? 3 : 1;
    const std::string raw(size_t(side) * (1 + (size_t(side) * size_t(bits * samples) + 7) / 8), '\0');
    std::string packed(compressBound(uLong(raw.size())), '\0');
    uLongf size = uLongf(packed.size());
    compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(raw.data()), uLong(raw.size()), 9);
    packed.resize(size);
    const auto big_endian = [](int v) { return std::string{char(v >> 24), char(v >> 16), char(v >> 8), char(v)}; };
    std::string out = "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", big_endian(side) + big_endian(side) + char(bits) + char(colour_type) +
                                                                  std::string(3, '\0'));
    if (colour_type == 3) out += png_chunk("PLTE", "\xff\x80\x01") + png_chunk("tRNS", "\x80");
    return out + png_chunk("IDAT", packed) + png_chunk("IEND", "");
}

TEST(ImageThatPacksWell, Loads) {
    const std::string scene = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\"";
    for (const auto& [bits, type] : {std::pair{1, 0}, {1, 3}, {2, 3}, {8, 3}, {8, 2}}) {
        const std::string png = flat_png(bits == 8 ? 512 : 2048, bits, type);
        const auto loaded = import_world(scene, {{"t.png", png}});
        EXPECT_TRUE(loaded.ok()) << bits << " bits, type " << type << ", " << png.size() << " bytes: " << loaded.status().message();
    }
    // What no PNG of the size holds is still refused before there is memory for it.
    std::string lie = flat_png(64, 8, 2);
    lie.replace(16, 8, std::string("\0\0\x40\0\0\0\x40\0", 8));
    expect_error(scene, {"t.png", "16384 x 16384", "cannot hold"}, {{"t.png", lie}});
}

/// One value everywhere, in half precision.
std::string flat_exr(int side, Imf::Compression compression) {
    Imf::Header header(side, side, 1, {0, 0}, 1, Imf::INCREASING_Y, compression);
    const std::vector<half> values(size_t(side), half(0.5f));
    Imf::FrameBuffer buffer;
    for (const char* channel : {"B", "G", "R"}) {
        header.channels().insert(channel, Imf::Channel(Imf::HALF));
        // Every line is the same one.
        buffer.insert(channel, Imf::Slice(Imf::HALF, reinterpret_cast<char*>(const_cast<half*>(values.data())), sizeof(half), 0));
    }
    ExrMemoryOutput stream;
    {
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(buffer);
        file.writePixels(side);
    }
    return std::move(stream.bytes);
}

TEST(ImageThatPacksWell, LoadsAsExrInEveryCompression) {
    for (const Imf::Compression compression :
         {Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION,
          Imf::B44A_COMPRESSION, Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION}) {
        const std::string bytes = flat_exr(1024, compression);
        const auto image = import::read_exr(bytes);
        ASSERT_TRUE(image.ok()) << int(compression) << ", " << bytes.size() << " bytes: " << image.status().message();
        EXPECT_NEAR(image->values.at(12345), 0.5f, 0.01f);
    }
}

// ------------------------------------------------------------------------------------------------------ transformations

TEST(SingularTransformation, MattersOnlyWhereSomethingIsPlaced) {
    const std::string camera = "Camera \"perspective\"\n";
    for (const char* set :
         {"Scale 0 1 1", "ConcatTransform [0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1]", "Transform [0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0]",
          "Rotate 10 0 0 0", "LookAt 1 1 1 1 1 1 0 1 0", "Scale 1e30 1e30 1e30 Scale 1e300 1e300 1e300"}) {
        const std::string directive = set;
        EXPECT_EQ(world("AttributeBegin " + directive + " AttributeEnd " + kTriangle).meshes.size(), 1u) << set;
        EXPECT_EQ(world(directive + " Identity " + kTriangle).meshes.size(), 1u) << set;
        for (const std::string& placed : {std::string(kTriangle), std::string("Shape \"sphere\""),
                                          std::string("LightSource \"point\""), std::string("ObjectInstance \"o\"")})
            expect_error(directive + "\nTranslate 1 2 3\n" + placed, {"scene.pbrt:5", "cannot be placed", "since scene.pbrt:3"});
        const auto bad_camera = import_text(directive + " " + camera + "WorldBegin");
        ASSERT_FALSE(bad_camera.ok());
        EXPECT_NE(bad_camera.status().message().find("the camera cannot be placed"), std::string::npos);
    }
    expect_error(
        std::string("CoordinateSystem \"a\" Scale 0 1 1 CoordinateSystem \"b\" Identity CoordSysTransform \"b\"\n") + kTriangle,
        {"scene.pbrt:4", "since scene.pbrt:3"});
}

// -------------------------------------------------------------------------------------------------------------- places

Result<ImportedScene> import_below(const std::string& text, FileMap files, std::vector<std::string> above,
                                   size_t* levels = nullptr) {
    files["scene.pbrt"] = "PixelFilter \"box\"\nWorldBegin\n" + text;
    import::MemorySource source(std::move(files), std::move(above));
    auto scene = import::import_from(&source, "scene.pbrt", {});
    if (levels) *levels = source.levels();
    return scene;
}

TEST(ScenePlaces, ReferencesGoUpToTheRoot) {
    const FileMap files{{"../common/a.pbrt", kTriangle}, {"../../b.pbrt", kTriangle}, {"c.pbrt", kTriangle}};
    const std::vector<std::string> above{"room", "scenes"};
    size_t levels = 9;
    auto scene = import_below("Include \"../common/./x/../a.pbrt\" Include \"c.pbrt\"", files, above, &levels);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(levels, 1u);
    EXPECT_EQ(scene->files, (std::vector<std::string>{"room/scene.pbrt", "common/a.pbrt", "room/c.pbrt"}));
    EXPECT_EQ(scene->description.meshes.at(0).attributes.source, "../common/a.pbrt:1");
    scene = import_below("Include \"../../b.pbrt\" Include \"../room/c.pbrt\"", files, above, &levels);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(levels, 2u);
    EXPECT_EQ(scene->files, (std::vector<std::string>{"scenes/room/scene.pbrt", "b.pbrt", "scenes/room/c.pbrt"}));
    // One directory more than there are.
    scene = import_below("Include \"../../../b.pbrt\"", {{"../../../b.pbrt", kTriangle}}, above);
    ASSERT_FALSE(scene.ok());
    EXPECT_NE(scene.status().message().find("leaves"), std::string::npos) << scene.status().message();
    EXPECT_NE(scene.status().message().find("--root"), std::string::npos) << scene.status().message();
}

/// As pbrt does for scenes that name files from the directory in which it was started.
TEST(ScenePlaces, ReferencesFromADirectoryAboveAreFound) {
    const std::vector<std::string> above{"room", "scenes"};
    const FileMap files{{"a.pbrt", kTriangle}, {"../other/b.pbrt", kTriangle}};
    size_t levels = 9;
    auto scene = import_below("Include \"scenes/room/a.pbrt\" Include \"other/b.pbrt\"", files, above, &levels);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(levels, 2u) << "the root must hold the directory from which the file was named";
    EXPECT_EQ(scene->files, (std::vector<std::string>{"scenes/room/scene.pbrt", "scenes/room/a.pbrt", "scenes/other/b.pbrt"}));
    // The nearest one counts.
    scene = import_below("Include \"x.pbrt\"", {{"x.pbrt", ""}, {"../x.pbrt", kTriangle}}, above, &levels);
    ASSERT_TRUE(scene.ok());
    EXPECT_EQ(levels, 0u);
    EXPECT_TRUE(scene->description.meshes.empty());
}

class Directory {
  public:
    Directory() {
        std::string name = (std::filesystem::temp_directory_path() / "lightloom-XXXXXX").string();
        if (::mkdtemp(name.data())) path = std::filesystem::canonical(name);
    }
    ~Directory() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
    }
    void write(const std::string& name, const std::string& text) const {
        std::filesystem::create_directories((path / name).parent_path());
        std::ofstream(path / name) << text;
    }
    std::filesystem::path path;
};

/// What arrives elsewhere is the root with the files listed: the same scene must be read from it, and nothing outside.
TEST(ScenePlaces, TheCopiedRootIsTheSameScene) {
    const Directory here, there;
    here.write("a/b/scenes/room/scene.pbrt",
               "PixelFilter \"box\"\nWorldBegin\nInclude \"../../x/one.pbrt\"\nInclude \"scenes/two.pbrt\"\n");
    here.write("a/b/x/one.pbrt", kTriangle);
    here.write("a/b/scenes/two.pbrt", kTriangle);
    here.write("secret.pbrt", kTriangle);
    const std::string main = "a/b/scenes/room/scene.pbrt";
    const auto first = import_pbrt(here.path / main);
    ASSERT_TRUE(first.ok()) << first.status().message();
    EXPECT_EQ(first->directory, here.path / "a/b");
    EXPECT_EQ(first->files, (std::vector<std::string>{"scenes/room/scene.pbrt", "x/one.pbrt", "scenes/two.pbrt"}));
    for (const std::string& file : first->files) {
        std::filesystem::create_directories((there.path / "root" / file).parent_path());
        std::filesystem::copy_file(std::filesystem::path(first->directory) / file, there.path / "root" / file);
    }
    there.write("secret.pbrt", kTriangle);
    const ImportOptions bounded{.root = there.path / "root"};
    const std::string copy = there.path / "root" / first->files[0];
    const auto second = import_pbrt(copy, bounded);
    ASSERT_TRUE(second.ok()) << second.status().message();
    EXPECT_EQ(second->files, first->files);
    EXPECT_EQ(second->description.meshes.at(1).attributes.source, first->description.meshes.at(1).attributes.source);
    for (const char* outside : {"../../../secret.pbrt", "secret.pbrt", "/etc/passwd", "../../../../../../../etc/passwd"}) {
        there.write("root/scenes/room/scene.pbrt", "WorldBegin Include \"" + std::string(outside) + "\"");
        EXPECT_FALSE(import_pbrt(copy, bounded).ok()) << outside;
    }
    EXPECT_FALSE(import_pbrt(here.path / main, {.root = there.path}).ok()) << "not below the root";
    EXPECT_TRUE(import_pbrt(here.path / main, {.root = here.path}).ok());
}

TEST(ScenePlaces, TheDefaultRootIsThreeLevelsUp) {
    const Directory here;
    here.write("1/2/3/4/scene.pbrt", "PixelFilter \"box\" WorldBegin Include \"../../../a.pbrt\"");
    here.write("1/a.pbrt", "");
    EXPECT_TRUE(import_pbrt(here.path / "1/2/3/4/scene.pbrt").ok());
    here.write("1/2/3/4/scene.pbrt", "PixelFilter \"box\" WorldBegin Include \"../../../../a.pbrt\"");
    here.write("a.pbrt", "");
    EXPECT_FALSE(import_pbrt(here.path / "1/2/3/4/scene.pbrt").ok());
    EXPECT_TRUE(import_pbrt(here.path / "1/2/3/4/scene.pbrt", {.root = here.path}).ok());
}

/// Linear in their number: a public scene has 100000.
TEST(ScenePlaces, ManySmallFilesAreIncluded) {
    constexpr int kFiles = 120000;
    FileMap files;
    std::string text;
    for (int i = 0; i < kFiles; ++i) {
        const std::string name = std::to_string(i) + ".pbrt";
        files.emplace(name, "ReverseOrientation\n");
        text.append("Include \"").append(name).append("\"\n");
    }
    const auto begin = std::chrono::steady_clock::now();
    const auto scene = import_below(text, std::move(files), {});
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->files.size(), size_t(kFiles) + 1);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

}  // namespace
}  // namespace lightloom
