// Cylinders, and parts of spheres and disks: triangles with the area, the normals and the (u, v) of the true shapes.

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/scene/scene.h"
#include "import_testing.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::world;

Vec3 cross_of(const TriangleMesh& mesh, size_t triangle) {
    const uint32_t* v = &mesh.indices[triangle * 3];
    return cross(mesh.positions[v[1]] - mesh.positions[v[0]], mesh.positions[v[2]] - mesh.positions[v[0]]);
}

double area_of(const TriangleMesh& mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh.indices.size() / 3; ++i) sum += 0.5 * double(length(cross_of(mesh, i)));
    return sum;
}

TriangleMesh mesh_of(const std::string& text) {
    const SceneDescription d = world(text);
    EXPECT_EQ(d.meshes.size(), 1u) << text;
    return d.meshes.empty() ? TriangleMesh{} : d.meshes[0];
}

/// A part of a quadric about the z axis, in its own space.
struct Quadric {
    const char* text;
    double area;
    Vec2 (*uv)(const Vec3& p);       ///< From a point on it.
    Vec3 (*normal)(const Vec3& p);   ///< pbrt's outside.
    double (*error)(const Vec3& p);  ///< Distance from it over the radius.
};

double turns(const Vec3& p) {
    const double phi = std::atan2(double(p.y), double(p.x)) / (2 * M_PI);
    return phi < -1e-7 ? phi + 1 : std::max(phi, 0.0);
}
double across(const Vec3& p) { return std::hypot(double(p.x), double(p.y)); }
Vec3 radial(const Vec3& p) { return normalize(Vec3{p.x, p.y, 0}); }
Vec3 up(const Vec3&) { return {0, 0, 1}; }

constexpr double kPolar = 1.0471975511965976;  // acos(1 / 2)

const Quadric kQuadrics[] = {
    {"Shape \"cylinder\"", 4 * M_PI,
     [](const Vec3& p) {
         return Vec2{float(turns(p)), (p.z + 1) / 2};
     },
     radial, [](const Vec3& p) { return across(p) - 1; }},
    {"Shape \"cylinder\" \"float radius\" 2 \"float zmin\" 0.5 \"float zmax\" 1.5 \"float phimax\" 250", 250 / 180.0 * M_PI * 2,
     [](const Vec3& p) {
         return Vec2{float(turns(p) * 360 / 250), p.z - 0.5f};
     },
     radial, [](const Vec3& p) { return across(p) / 2 - 1; }},
    {"Shape \"disk\" \"float radius\" 2 \"float innerradius\" 1 \"float height\" 3 \"float phimax\" 100",
     0.5 * 100 / 180.0 * M_PI * 3,
     [](const Vec3& p) {
         return Vec2{float(turns(p) * 3.6), float(2 - across(p))};
     },
     up, [](const Vec3& p) { return double(p.z) - 3; }},
    {"Shape \"disk\" \"float phimax\" 7", 0.5 * 7 / 180.0 * M_PI,
     [](const Vec3& p) {
         return Vec2{float(turns(p) * 360 / 7), float(1 - across(p))};
     },
     up, [](const Vec3& p) { return double(p.z); }},
    {"Shape \"sphere\" \"float radius\" 2 \"float zmin\" -1 \"float zmax\" 1 \"float phimax\" 200", 200 / 180.0 * M_PI * 2 * 2,
     [](const Vec3& p) {
         return Vec2{float(turns(p) * 1.8), float((std::acos(double(normalize(p).z)) - 2 * kPolar) / (kPolar - 2 * kPolar))};
     },
     [](const Vec3& p) { return normalize(p); }, [](const Vec3& p) { return double(length(p)) / 2 - 1; }},
    {"Shape \"sphere\" \"float zmin\" 0", 2 * M_PI,
     [](const Vec3& p) {
         return Vec2{float(turns(p)), float(1 - std::acos(double(normalize(p).z)) / (M_PI / 2))};
     },
     [](const Vec3& p) { return normalize(p); }, [](const Vec3& p) { return double(length(p)) - 1; }},
    {"Shape \"sphere\" \"float phimax\" 90", M_PI,
     [](const Vec3& p) {
         return Vec2{float(turns(p) * 4), float(1 - std::acos(double(normalize(p).z)) / M_PI)};
     },
     [](const Vec3& p) { return normalize(p); }, [](const Vec3& p) { return double(length(p)) - 1; }},
};

TEST(ImportQuadrics, AreTheTrueShapesWithinTheirTolerance) {
    for (const Quadric& q : kQuadrics) {
        const TriangleMesh mesh = mesh_of(q.text);
        EXPECT_NEAR(area_of(mesh) / q.area, 1, 2e-6) << q.text;
        for (size_t i = 0; i < mesh.positions.size(); ++i) {
            const Vec3& p = mesh.positions[i];
            EXPECT_LT(std::fabs(q.error(p)), 3e-4) << q.text;
            if (!mesh.normals.empty()) {
                EXPECT_LT(length(mesh.normals[i] - q.normal(p)), 1e-5f) << q.text;
            }
            const Vec2 uv = q.uv(p);
            // At the seam and on the axis the angle is not that of the point.
            if (across(p) > 1e-3 && mesh.uvs[i].x < 0.999f) {
                EXPECT_NEAR(mesh.uvs[i].x, uv.x, 1e-5f) << q.text;
            }
            EXPECT_NEAR(mesh.uvs[i].y, uv.y, 2e-3f) << q.text;
        }
        double farthest = 0;
        for (size_t i = 0; i < mesh.indices.size() / 3; ++i) {
            Vec3 centre;
            for (size_t k = 0; k < 3; ++k) centre += mesh.positions[mesh.indices[i * 3 + k]] / 3;
            farthest = std::max(farthest, std::fabs(q.error(centre)));
            EXPECT_GT(dot(normalize(cross_of(mesh, i)), q.normal(centre)), 0.999f) << q.text;
        }
        EXPECT_LT(farthest, 4e-4) << q.text;
        expect_warning(q.text, "exactly");
    }
    // A cap covers its cylinder.
    const TriangleMesh tube = mesh_of("Shape \"cylinder\""), cap = mesh_of("Shape \"disk\"");
    for (size_t i = 0; i < tube.positions.size(); i += 2) {
        const Vec3 &rim = cap.positions[i + 1], &edge = tube.positions[i];
        EXPECT_GT(across(rim), across(edge));
        EXPECT_NEAR(rim.x * edge.y - rim.y * edge.x, 0, 1e-6);
    }
}

/// Which side is the outside, as a factor: after ReverseOrientation, after a mirroring, and both, where a ray hits and where it
/// shines.
TEST(ImportQuadrics, SidesFollowReversalAndMirrors) {
    for (const Quadric& q : kQuadrics)
        for (const bool reversed : {false, true})
            for (const bool mirrored : {false, true})
                for (const bool shines : {false, true}) {
                    const std::string text = std::string(reversed ? "ReverseOrientation " : "") +
                                             (mirrored ? "Scale 1 1 -1 " : "") + (shines ? "AreaLightSource \"diffuse\" " : "");
                    Result<std::unique_ptr<Scene>> scene = Scene::build(world(text + q.text), {8, 8});
                    ASSERT_TRUE(scene.ok()) << scene.status().message();
                    const TriangleMesh& mesh = (*scene)->description().meshes[0];
                    // pbrt turns what a ray hits for a mirror too, where it samples light it does not.
                    const float side = (reversed ? -1.0f : 1.0f) * (mirrored && !shines ? -1.0f : 1.0f);
                    const size_t middle = mesh.indices.size() / 6;
                    Vec3 centre;
                    for (size_t k = 0; k < 3; ++k) centre += mesh.positions[mesh.indices[middle * 3 + k]] / 3;
                    Vec3 outside = q.normal(mirrored ? Vec3{centre.x, centre.y, -centre.z} : centre);
                    if (mirrored) outside.z = -outside.z;
                    SurfacePoint point;
                    ASSERT_TRUE((*scene)->intersect(centre + outside * 0.01f, -outside, &point)) << text << q.text;
                    EXPECT_GT(dot(point.ng, outside) * side, 0.99f) << text << q.text;
                    EXPECT_GT(dot(point.shading.n, outside) * side, 0.99f) << text << q.text;
                    ASSERT_EQ(point.emitter != kNone, shines);
                    if (shines) {
                        const Emitter& e = (*scene)->emitters()[uint32_t(point.emitter)];
                        EXPECT_GT(dot(e.normal, outside) * side, 0.99f) << text << q.text;
                    }
                }
}

TEST(ImportQuadrics, EmitTheirPower) {
    for (const Quadric& q : kQuadrics) {
        Result<std::unique_ptr<Scene>> scene =
            Scene::build(world(std::string("AreaLightSource \"diffuse\" \"float power\" 10 ") + q.text), {8, 8});
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        double power = 0;
        for (const SceneSummary::Light& light : (*scene)->summary().lights) power += light.power;
        EXPECT_NEAR(power, 10, 1e-2) << q.text;
        scene = Scene::build(world(std::string("AreaLightSource \"diffuse\" \"rgb L\" [1 1 1] ") + q.text), {8, 8});
        power = 0;
        for (const SceneSummary::Light& light : (*scene)->summary().lights) power += light.power;
        EXPECT_NEAR(power / (M_PI * q.area), 1, 1e-3) << q.text;
    }
    const auto warnings = world("AreaLightSource \"diffuse\" \"float power\" 10 Scale 3 3 3 Shape \"cylinder\"").warnings;
    EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                            [](const std::string& w) { return w.find("before the transformation") != std::string::npos; }),
              1);
}

TEST(ImportQuadrics, Errors) {
    for (const char* kind : {"\"cylinder\"", "\"sphere\""}) {
        const std::string shape = std::string("Shape ") + kind;
        expect_error(shape + " \"float radius\" 0", {"scene.pbrt:3", "radius", "positive"});
        expect_error(shape + " \"float radius\" -1", {"radius", "positive"});
        expect_error(shape + " \"float phimax\" 0", {"scene.pbrt:3", "phimax", "positive"});
        expect_error(shape + " \"float phimax\" -90", {"phimax"});
        expect_error(shape + " \"float zmin\" 0.5 \"float zmax\" 0.5", {"scene.pbrt:3", "zmin", "leave nothing"});
        // The same shape, as pbrt has it.
        const auto swapped = world(shape + " \"float zmin\" 0.5 \"float zmax\" -0.5");
        EXPECT_EQ(swapped.meshes.at(0).positions, mesh_of(shape + " \"float zmin\" -0.5 \"float zmax\" 0.5").positions);
        EXPECT_EQ(swapped.warnings.size(), 2u);
        expect_error("Translate 1e16 0 0 " + shape + " \"float phimax\" 90", {"1e15"});
    }
    expect_error("Shape \"sphere\" \"float zmin\" 1 \"float zmax\" 2", {"leave nothing"});
    expect_error("Shape \"disk\" \"float phimax\" 0", {"phimax", "positive"});
    expect_error("Shape \"disk\" \"float innerradius\" 1", {"larger than innerradius"});
    expect_error("Shape \"disk\" \"float zmin\" 1", {"zmin"});
    expect_error("Shape \"cylinder\" \"float height\" 1", {"height"});
    expect_error("Shape \"curve\"", {"scene.pbrt:3", "curve", "not supported"});
    // What lies beyond a sphere or a full turn cuts nothing off.
    EXPECT_EQ(world("Shape \"sphere\" \"float zmin\" -2 \"float zmax\" 7 \"float phimax\" 400").spheres.size(), 1u);
}

}  // namespace
}  // namespace lightloom
