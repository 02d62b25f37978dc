// Loop's subdivision surfaces.

#include "common/import/subdivide.h"

#include <cmath>
#include <map>
#include <set>

#include "import_testing.h"

namespace lightloom {
namespace {

using import::loop_subdivide;
using testing::expect_error;
using testing::world;

struct Control {
    std::vector<Vec3> points;
    std::vector<uint32_t> indices;
};

/// Of two triangles per side, corners counter-clockwise from outside.
const Control kCube{{{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}},
                    {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 3, 7, 6, 3, 6, 2, 0, 4, 7, 0, 7, 3, 1, 2, 6, 1, 6, 5}};

/// A bent sheet with a hole: boundary vertices of all kinds, a point that nothing uses, and an inner vertex of valence 3.
const Control kSheet{{{0, 0, 0},
                      {1, 0, 0.2f},
                      {2, 0, 0.1f},
                      {0, 1, 0.3f},
                      {9, 9, 9},
                      {1, 1, -0.2f},
                      {2, 1, 0.4f},
                      {0, 2, 0},
                      {1, 2, 0.5f},
                      {2, 2, 0.1f},
                      {0.7f, 0.3f, 0.6f}},
                     {0, 1, 10, 1, 5, 10, 0, 10, 5, 0, 5, 3, 1, 2, 6, 1, 6, 5, 3, 5, 7, 5, 8, 7, 5, 6, 9, 5, 9, 8}};

struct P {
    double x = 0, y = 0, z = 0;
    void add(const P& o, double w) { x += o.x * w, y += o.y * w, z += o.z * w; }
};

/// The definition, with sets instead of walks: nothing of what is tested is used.
struct Plain {
    std::vector<P> points;
    std::vector<std::array<size_t, 3>> faces;
    std::map<std::pair<size_t, size_t>, std::vector<size_t>> opposite;  ///< By edge, lesser end first: the third corners beside it.

    static std::pair<size_t, size_t> edge(size_t a, size_t b) { return {std::min(a, b), std::max(a, b)}; }

    void find_edges() {
        opposite.clear();
        for (const auto& f : faces)
            for (size_t k = 0; k < 3; ++k) opposite[edge(f[k], f[(k + 1) % 3])].push_back(f[(k + 2) % 3]);
    }
    /// Weighted with its neighbours; `inner` from their number.
    P blended(size_t v, double (*inner)(double), double boundary) const {
        std::set<size_t> all, along;
        for (const auto& [e, others] : opposite) {
            if (e.first != v && e.second != v) continue;
            const size_t other = e.first == v ? e.second : e.first;
            all.insert(other);
            if (others.size() == 1) along.insert(other);
        }
        const double w = along.empty() ? inner(double(all.size())) : boundary;
        const std::set<size_t>& used = along.empty() ? all : along;
        P p;
        p.add(points[v], 1 - double(used.size()) * w);
        for (const size_t i : used) p.add(points[i], w);
        return p;
    }
    void subdivide() {
        find_edges();
        std::vector<P> made;
        for (size_t v = 0; v < points.size(); ++v)
            made.push_back(blended(
                v, [](double n) { return n == 3 ? 3.0 / 16 : 3 / (8 * n); }, 1.0 / 8));
        std::map<std::pair<size_t, size_t>, size_t> middle;
        for (const auto& [e, others] : opposite) {
            P p;
            const double w = others.size() == 1 ? 0.5 : 3.0 / 8;
            p.add(points[e.first], w), p.add(points[e.second], w);
            if (others.size() == 2) p.add(points[others[0]], 1.0 / 8), p.add(points[others[1]], 1.0 / 8);
            middle[e] = made.size();
            made.push_back(p);
        }
        std::vector<std::array<size_t, 3>> split;
        for (const auto& f : faces) {
            const size_t a = middle[edge(f[0], f[1])], b = middle[edge(f[1], f[2])], c = middle[edge(f[2], f[0])];
            split.push_back({f[0], a, c});
            split.push_back({a, f[1], b});
            split.push_back({c, b, f[2]});
            split.push_back({a, b, c});
        }
        points = made, faces = split;
    }
    std::vector<P> limits() {
        find_edges();
        std::vector<P> out;
        for (size_t v = 0; v < points.size(); ++v)
            out.push_back(blended(
                v, [](double n) { return 1 / (n + 3 / (8 * (n == 3 ? 3.0 / 16 : 3 / (8 * n)))); }, 1.0 / 5));
        return out;
    }
};

TriangleMesh subdivided(const Control& control, int levels) {
    Result<TriangleMesh> mesh = loop_subdivide(control.points, control.indices, levels, 1 << 20);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    return mesh.ok() ? std::move(mesh).value() : TriangleMesh{};
}

TEST(LoopSubdivision, EqualsItsDefinition) {
    for (const Control* control : {&kCube, &kSheet}) {
        Plain plain;
        for (const Vec3& p : control->points) plain.points.push_back({double(p.x), double(p.y), double(p.z)});
        for (size_t i = 0; i < control->indices.size(); i += 3)
            plain.faces.push_back({control->indices[i], control->indices[i + 1], control->indices[i + 2]});
        for (int levels = 0; levels <= 3; ++levels) {
            const TriangleMesh mesh = subdivided(*control, levels);
            const std::vector<P> limits = plain.limits();
            ASSERT_EQ(mesh.indices.size(), 3 * plain.faces.size());
            for (size_t f = 0; f < plain.faces.size(); ++f) {
                // Corners come in the same order, but the four children of a face begin where the child has its own corner.
                for (size_t k = 0; k < 3; ++k) {
                    const Vec3& p = mesh.positions[mesh.indices[3 * f + k]];
                    double nearest = HUGE_VAL;
                    for (size_t j = 0; j < 3; ++j) {
                        const P& q = limits[plain.faces[f][j]];
                        nearest = std::min(nearest, std::hypot(double(p.x) - q.x, double(p.y) - q.y, double(p.z) - q.z));
                    }
                    EXPECT_LT(nearest, 1e-6) << levels;
                }
            }
            plain.subdivide();
        }
    }
}

/// The limit of an inner vertex is known from the control mesh, however often it is subdivided first.
TEST(LoopSubdivision, LimitsDoNotDependOnTheLevels) {
    const TriangleMesh coarse = subdivided(kCube, 0);
    for (const int levels : {1, 2, 4}) {
        const TriangleMesh fine = subdivided(kCube, levels);
        EXPECT_EQ(fine.positions.size(), (kCube.indices.size() / 3 << (2 * levels)) / 2 + 2);
        for (size_t v = 0; v < 8; ++v) EXPECT_LT(length(fine.positions[v] - coarse.positions[v]), 1e-6f) << levels;
    }
    // Corner 6 has four neighbours, which sum to (1, 1, 1), with a weight of 1 / (4 + 4) each.
    for (size_t v = 0; v < 8; ++v) {
        Vec3 sum;
        std::set<uint32_t> ring;
        for (size_t i = 0; i < kCube.indices.size(); i += 3)
            for (size_t k = 0; k < 3; ++k)
                if (kCube.indices[i + k] == v) ring.insert({kCube.indices[i + (k + 1) % 3], kCube.indices[i + (k + 2) % 3]});
        for (const uint32_t i : ring) sum += kCube.points[i];
        const float n = float(ring.size());
        // 3 / (8 beta) is n, and 2 for three neighbours.
        const float w = 1 / (n + (n == 3 ? 2 : n));
        EXPECT_LT(length(coarse.positions[v] - (kCube.points[v] * (1 - n * w) + sum * w)), 1e-6f);
    }
}

TEST(LoopSubdivision, NormalsAreThoseOfTheSurface) {
    for (const Control* control : {&kCube, &kSheet}) {
        const TriangleMesh mesh = subdivided(*control, 4);
        std::vector<Vec3> sums(mesh.positions.size());
        for (size_t i = 0; i < mesh.indices.size(); i += 3) {
            const Vec3& a = mesh.positions[mesh.indices[i]];
            const Vec3 clockwise = cross(mesh.positions[mesh.indices[i + 2]] - a, mesh.positions[mesh.indices[i + 1]] - a);
            for (size_t k = 0; k < 3; ++k) sums[mesh.indices[i + k]] += clockwise;
        }
        for (size_t v = 0; v < mesh.positions.size(); ++v) {
            EXPECT_NEAR(length(mesh.normals[v]), 1, 1e-6f);
            EXPECT_GT(dot(mesh.normals[v], normalize(sums[v])), control == &kCube ? 0.999f : 0.95f) << v;
        }
    }
    // A plane stays one, whatever the valence of its vertices, to its boundary.
    Control flat = kSheet;
    for (Vec3& p : flat.points) p.z = 0;
    for (const int levels : {0, 1, 2})
        for (const Vec3& n : subdivided(flat, levels).normals) EXPECT_LT(length(n - Vec3{0, 0, -1}), 1e-5f);
    // Fans around one boundary vertex of two to seven neighbours.
    for (uint32_t n = 2; n <= 7; ++n) {
        Control fan{{{0, 0, 0}}, {}};
        for (uint32_t i = 0; i < n; ++i) {
            const double angle = M_PI * 0.9 * i / (n - 1);
            fan.points.push_back({float(std::cos(angle)), float(std::sin(angle)), 0});
            if (i > 0) fan.indices.insert(fan.indices.end(), {0, i, i + 1});
        }
        for (const Vec3& normal : subdivided(fan, 1).normals) EXPECT_LT(length(normal - Vec3{0, 0, -1}), 1e-5f) << n;
    }
    // Also where the tangents fail: three points on a line, and a surface that is folded onto itself.
    const TriangleMesh none = subdivided({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {0, 1, 2}}, 1);
    for (const Vec3& n : none.normals) EXPECT_EQ(length(n), 1);
    const TriangleMesh pillow = subdivided({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2, 0, 2, 1}}, 2);
    for (const Vec3& n : pillow.normals) EXPECT_NEAR(length(n), 1, 1e-6f);
}

TEST(LoopSubdivision, OfAScene) {
    std::string cube = "Shape \"loopsubdiv\" \"integer levels\" 2 \"string scheme\" \"loop\" \"point3 P\" [";
    for (const Vec3& p : kCube.points) cube += std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + " ";
    cube += "] \"integer indices\" [";
    for (const uint32_t i : kCube.indices) cube += std::to_string(i) + " ";
    cube += "] ";
    const SceneDescription d = world(cube);
    ASSERT_EQ(d.meshes.size(), 1u);
    EXPECT_TRUE(d.warnings.empty());
    EXPECT_EQ(d.meshes[0].indices.size(), 12u * 16 * 3);
    // As in pbrt, normals of a surface with counter-clockwise faces point inwards; ReverseOrientation turns them, a mirror does
    // not.
    const auto inward = [](const SceneDescription& s) { return dot(s.meshes.at(0).normals[6], s.meshes[0].positions[6]) < 0; };
    EXPECT_TRUE(inward(d));
    EXPECT_FALSE(inward(world("ReverseOrientation " + cube)));
    EXPECT_TRUE(inward(world("Scale 1 -2 1 " + cube)));
    // The default is three levels. A power is every triangle's, as in pbrt.
    const std::string triangle = "\"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] ";
    EXPECT_EQ(world("Shape \"loopsubdiv\" " + triangle).meshes.at(0).indices.size(), 64u * 3);
    const SceneDescription lamp = world("AreaLightSource \"diffuse\" \"float power\" 3 Shape \"loopsubdiv\" " + triangle);
    ASSERT_EQ(lamp.warnings.size(), 1u);
    EXPECT_NE(lamp.warnings[0].find("each of the 64 triangles"), std::string::npos) << lamp.warnings[0];
}

TEST(LoopSubdivision, Errors) {
    const std::string start = "Shape \"loopsubdiv\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1] ";
    const std::string one = "\"integer indices\" [0 1 2] ";
    expect_error(start + one + "\"integer levels\" -1", {"scene.pbrt:3", "levels", "negative"});
    expect_error(start + one + "\"integer levels\" 12", {"12 levels", "8388608", "fewer"});
    expect_error(start + one + "\"integer levels\" 2147483647", {"fewer levels"});
    expect_error(start + "\"integer indices\" [0 1 4]", {"scene.pbrt:3", "4 is out of range"});
    expect_error(start + "\"integer indices\" [0 1 -1]", {"out of range"});
    expect_error(start + "\"integer indices\" [0 1 2 3]", {"multiple of 3"});
    expect_error(start + "\"integer indices\" [0 1 1]", {"face 0", "two of its corners"});
    expect_error(start + "\"integer indices\" [0 1 2 0 1 3]", {"face 1", "same direction"});
    expect_error(start + "\"integer indices\" [0 1 2 1 0 3 0 1 3]", {"face 2", "at most two faces"});
    expect_error(start, {"integer indices"});
    expect_error("Shape \"loopsubdiv\" " + one, {"point3 P"});
    expect_error(start + one + "\"normal N\" [0 0 1]", {"N"});
    // Two surfaces that touch in a point are one surface of two parts.
    EXPECT_EQ(world("Shape \"loopsubdiv\" \"point3 P\" [0 0 0 1 0 0 1 1 0 -1 0 0 -1 -1 0] \"integer indices\" [0 1 2 0 3 4] "
                    "\"integer levels\" 1")
                  .meshes.at(0)
                  .indices.size(),
              8u * 3);
}

}  // namespace
}  // namespace lightloom
