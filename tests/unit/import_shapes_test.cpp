// Shapes and PLY files.

#include <zlib.h>

#include <cmath>
#include <cstring>
#include <regex>

#include "common/import/ply.h"
#include "import_testing.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::world;

double area_of(const TriangleMesh& mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
        const Vec3& a = mesh.positions[mesh.indices[i]];
        sum += 0.5 * double(length(cross(mesh.positions[mesh.indices[i + 1]] - a, mesh.positions[mesh.indices[i + 2]] - a)));
    }
    return sum;
}

Vec3 normal_of(const TriangleMesh& mesh, size_t triangle) {
    const uint32_t* v = &mesh.indices[triangle * 3];
    return normalize(cross(mesh.positions[v[1]] - mesh.positions[v[0]], mesh.positions[v[2]] - mesh.positions[v[0]]));
}

TEST(ImportMesh, NormalsFollowTheTransformationAndReversal) {
    const std::string mesh = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 1 0 1 0] \"normal N\" [-2 0 2 -2 0 2 -2 0 2]";
    const Vec3 n = world("Scale 2 1 1 " + mesh).meshes[0].normals[0];
    EXPECT_NEAR(n.x, -1 / std::sqrt(5.0f), 1e-6);
    EXPECT_NEAR(n.z, 2 / std::sqrt(5.0f), 1e-6);
    EXPECT_NEAR(world("ReverseOrientation Scale 2 1 1 " + mesh).meshes[0].normals[0].z, -2 / std::sqrt(5.0f), 1e-6);
    expect_warning("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 0 0 0 1 0 0 1]", "length zero");
}

TEST(ImportMesh, Errors) {
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]",
                 {"scene.pbrt:3", "out of range"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 -1]", {"out of range"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1]", {"multiple of 3"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 nan]", {"finite"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]", {"indices"});
    expect_error("Shape \"trianglemesh\"", {"point3 P"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1]", {"1 normals for 3"});
    expect_error("Scale 1e10 1 1 Shape \"trianglemesh\" \"point3 P\" [0 0 0 1e30 0 0 0 1 0]", {"not finite"});
    expect_error("Translate 1e16 0 0 Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]", {"scene.pbrt:3", "1e15"});
    expect_error("Translate 1e16 0 0 Shape \"sphere\"", {"scene.pbrt:3", "1e15"});
    expect_error("Shape \"sphere\" \"float radius\" 1e16", {"scene.pbrt:3", "1e15"});
    expect_error("Shape \"trianglemesh\" \"point3 P\" [-1e14 0 0 1e14 0 0 0 1e14 1e14]", {"scene.pbrt:3", "too large"});
    expect_error("Shape \"sphere\" \"float radius\" 1e-22", {"scene.pbrt:3", "too small"});
    expect_error("Shape \"curve\"", {"curve", "not supported"});
    expect_warning("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"vector3 S\" [1 0 0 1 0 0 1 0 0]", "S");
}

TEST(ImportSphere, SimilaritiesStaySpheresAndOthersBecomeTriangles) {
    const SceneDescription d = world("Translate 1 2 3 Rotate 90 1 0 0 Scale -2 2 2 Shape \"sphere\" \"float radius\" 0.5");
    ASSERT_EQ(d.spheres.size(), 1u);
    EXPECT_FLOAT_EQ(d.spheres[0].radius, 1);
    EXPECT_EQ(d.spheres[0].centre, (Vec3{1, 2, 3}));
    EXPECT_NEAR(d.spheres[0].orientation.n.y, -1, 1e-6);
    EXPECT_NEAR(d.spheres[0].orientation.s.x, -1, 1e-6);
    expect_warning("Scale 1 2 1 Shape \"sphere\"", "not a similarity");
    const TriangleMesh ellipsoid = world("Scale 1 2 1 Shape \"sphere\"").meshes.at(0);
    for (size_t i = 0; i < ellipsoid.indices.size() / 3; ++i) {
        const Vec3 centre = ellipsoid.positions[ellipsoid.indices[i * 3]];
        EXPECT_GT(dot(normal_of(ellipsoid, i), centre), 0) << i;
    }
    for (const Vec3& n : ellipsoid.normals) EXPECT_NEAR(length(n), 1, 1e-5);
    expect_error("Shape \"sphere\" \"float radius\" 0", {"positive"});
}

TEST(ImportDisk, HasTheExactArea) {
    expect_warning("Shape \"disk\"", "exactly the disk's area");
    const TriangleMesh disk = world("Shape \"disk\" \"float radius\" 2 \"float height\" 3").meshes.at(0);
    EXPECT_NEAR(area_of(disk), 4 * 3.14159265, 1e-4);
    for (size_t i = 0; i < disk.indices.size() / 3; ++i) EXPECT_NEAR(normal_of(disk, i).z, 1, 1e-5);
    EXPECT_EQ(disk.positions[0].z, 3);
    const TriangleMesh ring = world("Shape \"disk\" \"float radius\" 2 \"float innerradius\" 1").meshes.at(0);
    EXPECT_NEAR(area_of(ring), 3 * 3.14159265, 1e-4);
    expect_error("Shape \"disk\" \"float innerradius\" 1", {"larger than innerradius"});
}

TEST(ImportBilinearMesh, ParallelogramsAreTwoTriangles) {
    const TriangleMesh flat = world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]").meshes.at(0);
    EXPECT_EQ(flat.indices.size(), 6u);
    EXPECT_NEAR(area_of(flat), 2, 1e-6);
    EXPECT_NEAR(normal_of(flat, 0).z, 1, 1e-6);
    EXPECT_EQ(flat.uvs[3].x, 1);
    expect_warning("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]", "grid");
    expect_error("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1] \"integer indices\" [0 1 2]", {"multiple of 4"});
}

std::string ascii_header(const std::string& vertices, const std::string& faces) {
    return "ply\nformat ascii 1.0\nelement vertex " + vertices +
           "\nproperty float x\nproperty float y\nproperty float z\nelement face " + faces +
           "\nproperty list uchar int vertex_indices\nend_header\n";
}

/// A quad with normals and (u, v), in the given byte order.
std::string binary_quad(bool big) {
    std::string out = std::string("ply\r\nformat binary_") + (big ? "big" : "little") +
                      "_endian 1.0\r\ncomment x\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty double "
                      "z\r\nproperty float nx\r\n"
                      "property float ny\r\nproperty float nz\r\nproperty float u\r\nproperty float v\r\nelement face 1\r\n"
                      "property list uchar uint vertex_index\r\nend_header\r\n";
    const auto put = [&](auto value) {
        char raw[sizeof value];
        std::memcpy(raw, &value, sizeof value);
        if (big) std::reverse(raw, raw + sizeof value);
        out.append(raw, sizeof value);
    };
    for (const auto& [x, y] : {std::pair{0.f, 0.f}, {1.f, 0.f}, {1.f, 1.f}, {0.f, 1.f}}) {
        put(x), put(y), put(7.0);
        put(0.f), put(0.f), put(1.f), put(x), put(y);
    }
    put(uint8_t(4));
    for (uint32_t i = 0; i < 4; ++i) put(i);
    return out;
}

std::string gzip(const std::string& text) {
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, uLong(text.size())) + 64, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = uInt(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = uInt(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

TEST(Ply, AllFormatsAgree) {
    for (const bool big : {false, true}) {
        const auto mesh = import::read_ply(binary_quad(big));
        ASSERT_TRUE(mesh.ok()) << mesh.status().message();
        EXPECT_EQ(mesh->indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
        EXPECT_EQ(mesh->positions[2], (Vec3{1, 1, 7}));
        EXPECT_EQ(mesh->normals.size(), 4u);
        EXPECT_EQ(mesh->uvs[3].y, 1);
    }
    const auto ascii = import::read_ply(ascii_header("5", "2") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 .5 0\n5 0 1 2 3 4\n3 0 1 2");
    ASSERT_TRUE(ascii.ok()) << ascii.status().message();
    EXPECT_EQ(ascii->indices.size(), 12u);
    EXPECT_EQ(ascii->faces, (std::vector<uint32_t>{0, 0, 0, 1}));
    const auto mixed = import::read_ply(ascii_header("4", "4") +
                                        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
                                        "3 0 1 2\n3 0 2 3\n4 0 1 2 3\n3 0 1 2");
    ASSERT_TRUE(mixed.ok()) << mixed.status().message();
    EXPECT_EQ(mixed->faces, (std::vector<uint32_t>{0, 1, 2, 2, 3}));
    const auto triangles = import::read_ply(ascii_header("3", "1") + "0 0 0\n1 0 0\n1 1 0\n3 0 1 2");
    ASSERT_TRUE(triangles.ok()) << triangles.status().message();
    EXPECT_TRUE(triangles->faces.empty());
    const SceneDescription d =
        world("Shape \"plymesh\" \"string filename\" \"a.ply.gz\" Shape \"plymesh\" \"string filename\" \"a.ply\"",
              {{"a.ply.gz", gzip(binary_quad(false))}, {"a.ply", binary_quad(true)}});
    EXPECT_EQ(d.meshes.at(0).positions, d.meshes.at(1).positions);
    EXPECT_EQ(d.meshes.at(0).attributes.source, "scene.pbrt:3");
    const std::string pentagon = ascii_header("5", "1") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n-1 .5 0\n5 0 1 2 3 4";
    expect_warning("Shape \"plymesh\" \"string filename\" \"a.ply\"", "more than four", {{"a.ply", pentagon}});
}

/// Files with such normals exist. Where all are, the mesh has none, as in pbrt; where some are, the geometry's own stand in.
TEST(Ply, NormalsThatAreNoNumbersAreLeftOut) {
    const std::string text =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property float nx\nproperty float ny\nproperty float nz\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0 1\n1 0 0 nan nan nan\n0 1 0 0 0 1\n3 0 1 2\n";
    const auto mesh = import::read_ply(text);
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_EQ(mesh->normals[1], (Vec3{0, 0, 0}));
    const std::string shape = "Shape \"plymesh\" \"string filename\" \"a.ply\"";
    expect_warning(shape, "not finite;", {{"a.ply", text}});
    EXPECT_EQ(world(shape, {{"a.ply", text}}).meshes.at(0).normals.at(1), (Vec3{0, 0, 1}));
    const std::string none = std::regex_replace(text, std::regex("0 0 1\n"), "nan 0 0\n");
    expect_warning(shape, "left out", {{"a.ply", none}});
    EXPECT_TRUE(world(shape, {{"a.ply", none}}).meshes.at(0).normals.empty());
}

TEST(Ply, Errors) {
    const auto refused = [](const std::string& bytes, const char* part) {
        const auto mesh = import::read_ply(bytes);
        ASSERT_FALSE(mesh.ok()) << bytes;
        EXPECT_NE(mesh.status().message().find(part), std::string::npos) << mesh.status().message();
        EXPECT_EQ(mesh.status().message().find('\n'), std::string::npos);
    };
    refused("", "not a PLY");
    refused("plyx", "not a PLY");
    refused("ply\nformat ascii 1.0\n", "end_header");
    refused("ply\nend_header\n", "format");
    refused("ply\nformat binary_middle_endian 1.0\nend_header\n", "format");
    refused("ply\nformat ascii 1.0\nelement vertex many\nend_header\n", "count");
    refused("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "before the first element");
    refused("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "type");
    // Ten gigabytes that are not there.
    refused(ascii_header("900000000", "1") + "0 0 0\n", "claims 900000000");
    refused(
        "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\nproperty float x\nproperty float "
        "y\nproperty float z\nend_header\n",
        "claims");
    refused("ply\nformat ascii 1.0\nelement vertex 10000000000\nend_header\n", "no properties");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "not a finite");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "does not exist");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "does not exist");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 1 0\n2 0 1 2 0\n", "three or more");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 1 0\n255 0 1 2\n", "end");
    refused(ascii_header("3", "1") + "0 0 0\n1 0 0\n0 x 0\n3 0 1 2\n", "number");
    std::string cut = binary_quad(false);
    cut.resize(cut.size() - 1);
    refused(cut, "end");
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\"", {"scene.pbrt:3", "a.ply", "not a PLY"}, {{"a.ply", "oops"}});
    expect_error("Shape \"plymesh\" \"string filename\" \"missing.ply\"", {"scene.pbrt:3", "missing.ply"});
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\"", {"gzip"}, {{"a.ply", "\x1f\x8b garbage"}});
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\"", {"limit"}, {{"a.ply", gzip(std::string(4 << 20, 'x'))}});
    expect_error("Shape \"plymesh\" \"string filename\" \"a.ply\" \"texture displacement\" \"d\"", {"displacement"},
                 {{"a.ply", binary_quad(true)}});
}

}  // namespace
}  // namespace lightloom
