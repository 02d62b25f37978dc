// Displacement and normal maps, from the scene file to the shading frame of a hit.

#include <array>
#include <cmath>
#include <memory>

#include "common/scene/scene.h"
#include "import_looks.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::expect_warning;
using testing::FileMap;
using testing::png;
using testing::world;

/// A PFM of `rows` from the bottom, as its name says of one or three channels.
std::string pfm(int width, int height, int channels, const std::vector<float>& rows) {
    std::string out = std::string(channels == 3 ? "PF " : "Pf ") + std::to_string(width) + " " + std::to_string(height) + " -1\n";
    return out.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(float));
}

std::string number(double v) { return std::to_string(v); }

constexpr float kSlopeU = 0.8f, kSlopeV = -0.5f, kLevel = 0.3f;

/// The height at (u, v) where both lie in [1/8, 7/8], as of "h.pfm": linear between the centres of its pixels.
double height(double u, double v) { return double(kLevel) + double(kSlopeU) * u + double(kSlopeV) * v; }

FileMap files() {
    std::vector<float> ramp;
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x) ramp.push_back(float(height((x + 0.5) / 4, (y + 0.5) / 4)));
    return {{"h.pfm", pfm(4, 4, 1, ramp)}};
}

const std::string kRamp = R"(Texture "h" "float" "imagemap" "string filename" "h.pfm" )";
const std::string kBumped = kRamp + R"(Material "diffuse" "texture displacement" "h" )";

/// A parallelogram from (-1, 0, 0) along `a` and (0, 0, b), which faces up, with (u, v) along its edges.
std::string quad(float a, float b, bool normals) {
    return R"(Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point2 uv" [ 0 0 1 0 1 1 0 1 ] "point3 P" [ 0 0 0 )" +
           number(a) + " 0 0 " + number(a) + " 0 " + number(-b) + " 0 0 " + number(-b) + " ] " +
           (normals ? R"("normal N" [ 0 1 0 0 1 0 0 1 0 0 1 0 ])" : "") + "\n";
}

std::shared_ptr<const Scene> build(const std::string& text, FileMap more = {}) {
    FileMap all = files();
    all.merge(more);
    Result<std::unique_ptr<Scene>> scene = Scene::build(world(text, all));
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return std::move(scene).value();
}

SurfacePoint hit(const Scene& scene, const Vec3& o, const Vec3& d) {
    SurfacePoint point;
    EXPECT_TRUE(scene.intersect(o, normalize(d), &point));
    EXPECT_NEAR(length(point.shading.n), 1, 1e-5);
    EXPECT_NEAR(length(point.shading.s), 1, 1e-5);
    EXPECT_NEAR(dot(point.shading.s, point.shading.n), 0, 1e-5);
    EXPECT_NEAR(dot(cross(point.shading.n, point.shading.s), point.shading.t), 1, 1e-5);
    EXPECT_GE(dot(point.shading.n, point.ng), 0);
    return point;
}

void expect_vector(const Vec3& found, const Vec3& wanted, const std::string& what = "", float tolerance = 2e-4f) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(found[i], wanted[i], tolerance) << what << ", coordinate " << i;
}

TEST(Bump, OfAKnownSlopeGivesTheExpectedNormal) {
    const float a = 2, b = 1;
    for (const bool normals : {false, true}) {
        const SurfacePoint point = hit(*build(kBumped + quad(a, b, normals)), {1.1f, 1, -0.4f}, {0, -1, 0});
        // Along x by the slope per length; v runs along -z. With normals its length is that of u, as in pbrt.
        const Vec3 wanted = normalize(Vec3{-kSlopeU / a, 1, kSlopeV / (normals ? a : b)});
        expect_vector(point.shading.n, wanted, normals ? "with normals" : "without");
        EXPECT_EQ(point.ng, (Vec3{0, 1, 0}));
        // The tangent follows the relief.
        expect_vector(point.shading.s, normalize(Vec3{1, kSlopeU / a, 0}));
    }
}

/// A height may be negative: images of floats are not cut off at zero, as colours are.
TEST(Bump, OfNegativeHeightsTiltsTheOtherWay) {
    const auto tilted = [](const std::string& scale) {
        const auto scene =
            build(kRamp + "\"float scale\" " + scale + " Material \"diffuse\" \"texture displacement\" \"h\" " + quad(1, 1, false));
        return hit(*scene, {0.4f, 2, -0.6f}, {0, -1, 0}).shading.n;
    };
    const Vec3 up = tilted("1"), down = tilted("-1");
    EXPECT_LT(up.x, -0.1f);
    EXPECT_LT(length(Vec3{-up.x, up.y, -up.z} - down), 1e-4f);
}

TEST(Bump, GoesAlongTheSideThatTheNormalsShow) {
    const SurfacePoint turned = hit(*build(kBumped + "ReverseOrientation " + quad(2, 1, false)), {1.1f, 1, -0.4f}, {0, -1, 0});
    expect_vector(turned.shading.n, normalize(Vec3{-kSlopeU / 2, -1, kSlopeV}));
    // (u, v) that run the other way around: the relief is the same function of the place if the texture is mirrored with them.
    const std::string swapped =
        R"(Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ] "point2 uv" [ 0 0 0 1 1 1 1 0 ] "point3 P" [ 0 0 0 2 0 0 2 0 -1 0 0 -1 ])";
    const SurfacePoint point = hit(*build(kBumped + swapped), {1.1f, 1, -0.4f}, {0, -1, 0});
    expect_vector(point.shading.n, normalize(Vec3{-kSlopeV / 2, 1, kSlopeU}));
}

/// Against the cross product of numerical derivatives of p + h n.
TEST(Bump, OnSpheres) {
    for (const bool reversed : {false, true}) {
        const auto scene = build(kBumped + (reversed ? "ReverseOrientation " : "") + R"(Shape "sphere" "float radius" 3)");
        for (const auto& [u, v] : {std::array{0.3, 0.4}, {0.6, 0.7}, {0.2, 0.55}}) {
            const double side = reversed ? -1 : 1;
            const auto place = [&](double s, double t, double r) {
                const double phi = 2 * kPiD * s, theta = kPiD * (1 - t), sine = std::sin(theta);
                return std::array<double, 3>{r * sine * std::cos(phi), r * sine * std::sin(phi), r * std::cos(theta)};
            };
            const auto raised = [&](double s, double t) { return place(s, t, 3 + side * height(s, t)); };
            const double step = 1e-5;
            const auto derivative = [&](double s, double t) {
                const auto p = raised(u + s, v + t), q = raised(u - s, v - t);
                return Vec3{float((p[0] - q[0]) / (2 * step)), float((p[1] - q[1]) / (2 * step)),
                            float((p[2] - q[2]) / (2 * step))};
            };
            const Vec3 outward = normalize(cross(derivative(step, 0), derivative(0, step)));
            const auto from = place(u, v, 5);
            const Vec3 o{float(from[0]), float(from[1]), float(from[2])};
            expect_vector(hit(*scene, o, -o).shading.n, outward * float(side), reversed ? "reversed" : "as it is", 5e-4f);
        }
    }
}

TEST(Bump, OnInstances) {
    const std::string object = "ObjectBegin \"o\" " + kBumped + quad(2, 1, false) + " ObjectEnd ";
    // Three times as large: the same height rises a third as steeply. Turned, so that x becomes z.
    const auto scene = build(object + "Rotate -90 0 1 0 Scale 3 3 3 ObjectInstance \"o\"");
    expect_vector(hit(*scene, {1.2f, 1, 3.3f}, {0, -1, 0}).shading.n, normalize(Vec3{-kSlopeV / 3, 1, -kSlopeU / 6}));
    // Stretched along x alone.
    const auto stretched = build(object + "Scale 3 1 1 ObjectInstance \"o\"");
    expect_vector(hit(*stretched, {3.3f, 1, -0.4f}, {0, -1, 0}).shading.n, normalize(Vec3{-kSlopeU / 6, 1, kSlopeV}));
}

FileMap normal_map(const Vec3& n) { return {{"n.pfm", pfm(1, 1, 3, {(n.x + 1) / 2, (n.y + 1) / 2, (n.z + 1) / 2})}}; }
const std::string kMapped = R"(Material "diffuse" "string normalmap" "n.pfm" )";

TEST(NormalMap, TiltsByItsAngle) {
    const float angle = 0.5f, c = std::cos(angle), s = std::sin(angle);
    for (const bool normals : {false, true}) {
        const auto tilted = [&](const Vec3& n) {
            return hit(*build(kMapped + quad(2, 1, normals), normal_map(n)), {1.1f, 1, -0.4f}, {0, -1, 0}).shading;
        };
        expect_vector(tilted({s, 0, c}).n, {s, c, 0});
        expect_vector(tilted({s, 0, c}).s, {c, -s, 0});
        expect_vector(tilted({0, s, c}).n, {0, c, -s});
        expect_vector(tilted({0, s, c}).s, {1, 0, 0});
        // Normals in a map need not have the length one, nor lie above the surface.
        expect_vector(tilted({0.5f * s, 0, 0.5f * c}).n, {s, c, 0});
        expect_vector(tilted({s, 0, -c}).n, {-s, c, 0});
    }
    // On a sphere, around which u runs from x to y and v up: at (1, 0, 0) the normal leans towards y.
    const auto sphere = build(kMapped + "Shape \"sphere\"", normal_map({s, 0, c}));
    expect_vector(hit(*sphere, {5, 0, 0}, {-1, 0, 0}).shading.n, {c, s, 0});
}

TEST(NormalMap, EightBitCodesAreLinear) {
    const FileMap flat{{"n.png", png(1, 1, 2, std::string("\0\x80\x80\xff", 4))}};
    const auto scene = build(R"(Material "diffuse" "string normalmap" "n.png" )" + quad(2, 1, false), flat);
    const float t = 2 * 128 / 255.0f - 1;
    expect_vector(hit(*scene, {1.1f, 1, -0.4f}, {0, -1, 0}).shading.n, normalize(Vec3{t, 1, -t}), "", 1e-6f);
}

/// Shapes and instances of every kind, seen along -z.
const std::string kMany =
    "Shape \"sphere\" Translate 3 0 0 Scale 1 1.5 0.7 Shape \"sphere\" Identity Translate 6 0 0 Shape \"disk\" Identity "
    R"(Translate 9 0 0 Shape "bilinearmesh" "point3 P" [ -1 -1 0.3 1 -1 0 -1 1 0 1 1 0.1 ] Identity Translate 11 -1 0 Rotate 90 1 0 0 )";

void for_each_hit(const Scene& scene, const std::function<void(const SurfacePoint&, const Vec3&)>& visit) {
    for (float x = -0.7f; x < 14; x += 0.31f)
        for (const float y : {-0.6f, 0.2f, 0.5f}) {
            const Vec3 o{x, y, 5};
            SurfacePoint point;
            if (scene.intersect(o, {0, 0, -1}, &point)) visit(point, o);
        }
}

TEST(Bump, FlatMapsAreNoMaps) {
    const auto many = [](bool normals) { return kMany + quad(2, 2, normals); };
    for (const bool normals : {false, true}) {
        const auto plain = build(many(normals));
        const auto flat = build(R"(Texture "z" "float" "constant" "float value" 0 Material "diffuse" "texture displacement" "z" )" +
                                many(normals));
        const auto mapped = build(kMapped + many(normals), normal_map({0, 0, 1}));
        int points = 0;
        for_each_hit(*plain, [&](const SurfacePoint& point, const Vec3& o) {
            ++points;
            const SurfacePoint same = hit(*flat, o, {0, 0, -1}), close = hit(*mapped, o, {0, 0, -1});
            EXPECT_EQ(same.shading.n, point.shading.n);
            EXPECT_EQ(same.shading.s, point.shading.s);
            EXPECT_EQ(same.shading.t, point.shading.t);
            expect_vector(close.shading.n, point.shading.n, "map", 1e-6f);
            expect_vector(close.shading.s, point.shading.s, "map", 2e-6f);
        });
        EXPECT_GT(points, 60);
    }
}

/// The mirror image of a scene has the mirror image of its frames.
TEST(Bump, MirroredShapesAreMirrorImages) {
    const std::string object = "ObjectBegin \"o\" Shape \"sphere\" Translate 2 0 0 ", end = "ObjectEnd ";
    for (const bool normals : {false, true})
        for (const std::string& material : {kBumped, kMapped}) {
            const FileMap map = normal_map(normalize(Vec3{0.3f, -0.5f, 0.8f}));
            const std::string meshes = "Translate 0 -1 0 Rotate 90 1 0 0 " + quad(2, 2, normals);
            const std::string worlds[][2] = {
                {meshes, "Scale -1 1 1 " + meshes},
                {object + meshes + end + "ObjectInstance \"o\"", object + meshes + end + "Scale -1 1 1 ObjectInstance \"o\""},
                {object + meshes + end + "ObjectInstance \"o\"",
                 "ObjectBegin \"o\" Scale -1 1 1 Translate 2 0 0 " + meshes + end + "ObjectInstance \"o\""}};
            for (const auto& [first, second] : worlds) {
                const auto original = build(material + first, map), mirrored = build(material + second, map);
                int points = 0;
                for_each_hit(*original, [&](const SurfacePoint& point, const Vec3& o) {
                    SurfacePoint image;
                    if (!mirrored->intersect({-o.x, o.y, o.z}, {0, 0, -1}, &image)) return;  // the spheres of the third pair
                    expect_vector(image.shading.n, {-point.shading.n.x, point.shading.n.y, point.shading.n.z}, second, 1e-5f);
                    expect_vector(image.shading.s, {-point.shading.s.x, point.shading.s.y, point.shading.s.z}, second, 1e-5f);
                    ++points;
                });
                EXPECT_GT(points, 15);
            }
        }
}

TEST(Bump, AMixHasThatOfTheMaterialChosen) {
    const auto scene =
        build(kRamp + R"(MakeNamedMaterial "a" "string type" "diffuse" "texture displacement" "h" "rgb reflectance" [1 0 0]
        MakeNamedMaterial "b" "string type" "diffuse" "rgb reflectance" [0 1 0]
        MakeNamedMaterial "c" "string type" "mix" "string materials" ["a" "b"] "float amount" 0.5
        MakeNamedMaterial "d" "string type" "mix" "string materials" ["b" "c"] "float amount" 0.8 NamedMaterial "d" )" +
              quad(2, 1, false));
    int tilted = 0, flat = 0;
    for (int i = 0; i < 400; ++i) {
        const SurfacePoint point = hit(*scene, {0.3f + 0.0035f * float(i), 1, -0.4f}, {0, -1, 0});
        const bool chosen = scene->bsdf_at(point).reflectance.r > 0;
        if (chosen)
            expect_vector(point.shading.n, normalize(Vec3{-kSlopeU / 2, 1, kSlopeV}));
        else
            EXPECT_EQ(point.shading.n, (Vec3{0, 1, 0}));
        ++(chosen ? tilted : flat);
    }
    EXPECT_NEAR(tilted, 160, 40);
    EXPECT_NEAR(flat, 240, 40);
}

TEST(Bump, EveryKindOfMaterialTakesIt) {
    for (const char* kind :
         {"diffuse", "diffusetransmission", "conductor", "dielectric", "thindielectric", "coateddiffuse", "coatedconductor"}) {
        const auto bumped = build(kRamp + "Material \"" + kind + "\" \"texture displacement\" \"h\" " + quad(2, 1, false));
        const auto mapped = build(std::string("Material \"") + kind + "\" \"string normalmap\" \"n.pfm\" " + quad(2, 1, false),
                                  normal_map({0.6f, 0, 0.8f}));
        expect_vector(hit(*bumped, {1.1f, 1, -0.4f}, {0, -1, 0}).shading.n, normalize(Vec3{-kSlopeU / 2, 1, kSlopeV}), kind);
        expect_vector(hit(*mapped, {1.1f, 1, -0.4f}, {0, -1, 0}).shading.n, {0.6f, 0.8f, 0}, kind);
    }
}

/// What has no frame leaves the one that was there; nothing is ever no number.
TEST(Bump, ExtremesKeepAFrame) {
    const auto material = [](const std::string& value) {
        return kRamp + R"(Texture "e" "float" "scale" "texture tex" "h" "float scale" )" + value +
               R"( Material "diffuse" "texture displacement" "e" )";
    };
    for (const char* value : {"1e-30", "1e10", "1e30", "3e38", "-3e38"}) {
        const auto scene = build(material(value) + kMany + quad(2, 2, true));
        for_each_hit(*scene, [&](const SurfacePoint& point, const Vec3&) {
            for (const Vec3& v : {point.shading.s, point.shading.t, point.shading.n}) {
                EXPECT_TRUE(is_finite(v)) << value;
                EXPECT_NEAR(length(v), 1, 1e-4) << value;
            }
        });
    }
    const auto black = build(kMapped + quad(2, 1, false), normal_map({0, 0, 0}));
    EXPECT_EQ(hit(*black, {1.1f, 1, -0.4f}, {0, -1, 0}).shading.n, (Vec3{0, 1, 0}));
    // All of a triangle is one point of the texture.
    const auto degenerate = build(
        kBumped +
        R"(Shape "trianglemesh" "point2 uv" [ 0.5 0.5 0.5 0.5 0.5 0.5 ] "point3 P" [ 0 0 0 2 0 0 2 0 -2 ] "normal N" [ 0 1 0 0 1 0 0 1 0 ])");
    EXPECT_TRUE(is_finite(hit(*degenerate, {1.1f, 1, -0.4f}, {0, -1, 0}).shading.n));
}

/// A lamp shines by its geometry; only what it reflects is bumped.
TEST(Bump, LampsKeepTheirSide) {
    const auto lamp = [](const std::string& material) {
        return build(material + R"(AreaLightSource "diffuse" )" + quad(2, 1, false));
    };
    const SurfacePoint plain = hit(*lamp(""), {1.1f, 1, -0.4f}, {0, -1, 0}),
                       bumped = hit(*lamp(kBumped), {1.1f, 1, -0.4f}, {0, -1, 0});
    EXPECT_EQ(plain.ng, bumped.ng);
    EXPECT_EQ(plain.emitter, bumped.emitter);
    EXPECT_NE(plain.shading.n, bumped.shading.n);
}

TEST(Bump, InSceneFiles) {
    const SceneDescription constant = world(R"(Material "diffuse" "float displacement" 0.2 Shape "sphere")");
    EXPECT_NE(testing::material_of(constant).displacement, kNone);
    const SceneDescription both =
        world(kRamp + R"(Material "diffuse" "texture displacement" "h" "string normalmap" "" Shape "sphere")", files());
    EXPECT_NE(testing::material_of(both).displacement, kNone);
    expect_error(R"(Material "diffuse" "texture displacement" "no")", {"scene.pbrt:3", "no float texture is named \"no\""});
    expect_error(R"(Texture "s" "spectrum" "constant" Material "diffuse" "texture displacement" "s")", {"other type"});
    expect_error(R"(Material "conductor" "string normalmap" "no.png")", {"scene.pbrt:3", "no.png"});
    expect_error(R"(Material "conductor" "string normalmap" "n.pfm")", {"n.pfm", "red, green and blue"},
                 {{"n.pfm", pfm(1, 1, 1, {1})}});
    expect_error(R"(Material "diffuse" "rgb displacement" [1 1 1])", {"displacement", "wrong type"});
    expect_error(R"(MakeNamedMaterial "a" "string type" "diffuse" )"
                 R"(Material "mix" "string materials" ["a" "a"] "float displacement" 1)",
                 {"mix", "displacement", "give it to those"});
    expect_warning(R"(MakeNamedMaterial "a" "string type" "diffuse" )"
                   R"(Material "mix" "string materials" ["a" "a"] "string normalmap" "n.png")",
                   "give it to those");
    expect_warning(R"(Material "diffuse" "string normalmap" "n.pfm" "float displacement" 1)", "beside a normal map",
                   normal_map({0, 0, 1}));
    expect_warning(R"(Material "diffuse" "string normalmap" "n.tga")", "decoded as sRGB",
                   {{"n.tga", testing::tga(1, 1, "\xff\x80\x80")}});
    expect_warning(R"(Material "interface" "float displacement" 1 Shape "sphere")", "no surface");
    expect_error(R"(Shape "plymesh" "string filename" "a.ply" "texture displacement" "d")", {"--without displacement"});
}

}  // namespace
}  // namespace lightloom
