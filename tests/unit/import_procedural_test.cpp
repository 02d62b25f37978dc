// Textures that are computed, and the mappings of 2D textures.

#include <array>
#include <cmath>

#include "common/core/rng.h"
#include "common/import/context.h"
#include "common/scene/noise.h"
#include "common/scene/scene.h"
#include "import_looks.h"

namespace lightloom {
namespace {

using testing::expect_error;
using testing::kShape;
using testing::material_of;
using testing::value;
using testing::world;

/// The spectrum texture "t" that `texture` defines, as the colour of a material.
SceneDescription coloured(const std::string& texture, testing::FileMap files = {}) {
    return world(texture + " Identity Material \"diffuse\" \"texture reflectance\" \"t\" " + kShape, std::move(files));
}

/// The float texture "t" as an alpha.
SceneDescription faded(const std::string& texture) { return world(texture + " Identity Shape \"sphere\" \"texture alpha\" \"t\""); }

float alpha_at(const SceneDescription& d, const Vec3& p) { return value(d, d.spheres.at(0).attributes.alpha, {}, p).r; }

const std::string kPlace = "Translate 1 2 3 Scale 2 2 4 ";
Vec3 in_place(const Vec3& p) { return {(p.x - 1) / 2, (p.y - 2) / 2, (p.z - 3) / 4}; }

TEST(ProceduralTexture, NoiseIsThatOfThePlaceInTheTexturesSpace) {
    const SceneDescription fbm = faded(kPlace + "Texture \"t\" \"float\" \"fbm\" \"integer octaves\" 5 \"float roughness\" 0.625");
    const SceneDescription wrinkled = faded(kPlace + "Texture \"t\" \"float\" \"wrinkled\"");
    const SceneDescription windy = faded(kPlace + "Texture \"t\" \"float\" \"windy\"");
    const SceneDescription marbled =
        coloured(kPlace + "Texture \"t\" \"spectrum\" \"marble\" \"float scale\" 3 \"float variation\" 0.5 \"integer octaves\" 4");
    for (const Vec3& p : {Vec3{0.25f, 0.5f, 0.75f}, Vec3{-3.25f, 10.5f, 2.125f}, Vec3{7.5f, -1.75f, 0.375f}}) {
        const Vec3 q = in_place(p);
        EXPECT_EQ(alpha_at(fbm, p), fractal_noise(q, 0.625f, 5));
        EXPECT_EQ(alpha_at(wrinkled, p), turbulence(q, 0.5f, 8));
        EXPECT_EQ(alpha_at(windy, p), std::fabs(fractal_noise(q * 0.1f, 0.5f, 3)) * fractal_noise(q, 0.5f, 6));
        EXPECT_EQ(value(marbled, material_of(marbled).reflectance, {}, p), marble(q * 3, 0.5f, 4, 0.5f));
    }
    EXPECT_EQ(fbm.texture_spaces.size(), 1u);
    // One space serves all textures that are defined in it.
    EXPECT_EQ(world("Texture \"a\" \"float\" \"windy\" Texture \"b\" \"float\" \"fbm\"").texture_spaces.size(), 1u);
    EXPECT_TRUE(world("Translate 1 0 0 Texture \"a\" \"float\" \"checkerboard\"").texture_spaces.empty());
}

TEST(ProceduralTexture, SolidCheckerboard) {
    const SceneDescription d = coloured(
        kPlace + "Texture \"t\" \"spectrum\" \"checkerboard\" \"integer dimension\" 3 \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0]");
    Rng rng({1});
    for (int i = 0; i < 1000; ++i) {
        const float x = rng.uniform() * 20 - 10, y = rng.uniform() * 20 - 10;
        const Vec3 p{x, y, rng.uniform() * 20 - 10}, q = in_place(p);
        const bool odd = (int(std::floor(q.x) + std::floor(q.y) + std::floor(q.z)) & 1) != 0;
        EXPECT_EQ(value(d, material_of(d).reflectance, {}, p), odd ? Rgb(0, 1, 0) : Rgb(1, 0, 0));
    }
    EXPECT_EQ(value(d, material_of(d).reflectance, {}, {1e30f, 0, 0}), Rgb(1, 0, 0));
    expect_error("Texture \"t\" \"float\" \"checkerboard\" \"integer dimension\" 4", {"scene.pbrt:3", "2 or 3"});
}

TEST(ProceduralTexture, Dots) {
    const SceneDescription d = coloured(
        "Texture \"t\" \"spectrum\" \"dots\" \"rgb inside\" [1 0 0] \"rgb outside\" [0 0 1] \"float uscale\" 6 \"float vscale\" 4");
    for (const Vec2 uv : {Vec2{0.5f, 0.25f}, Vec2{0.17f, 0.5f}, Vec2{0.9f, 0.1f}, Vec2{0.33f, 0.77f}})
        EXPECT_EQ(value(d, material_of(d).reflectance, uv), inside_dot({6 * uv.x, 4 * uv.y}) ? Rgb(1, 0, 0) : Rgb(0, 0, 1));
    const SceneDescription plain = faded("Texture \"t\" \"float\" \"dots\"");
    EXPECT_EQ(value(plain, plain.spheres[0].attributes.alpha, {1, 2}).r, 1);
    EXPECT_EQ(value(plain, plain.spheres[0].attributes.alpha, {0.5f, 0.5f}).r, 0);
}

/// A picture of 4 x 4 texels that tell where they are: the left one of the bottom row is black, red grows with s, green with t.
const std::string kGrid = [] {
    std::string bgr;
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x) bgr += {'\0', char(80 * y), char(80 * x)};
    return testing::tga(4, 4, bgr);
}();

/// Column and row of the texel that a picture with this mapping shows at `p`.
std::array<int, 2> texel_at(const std::string& mapping, const Vec3& p) {
    const SceneDescription d = coloured(
        kPlace + "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"g.tga\" \"string filter\" \"point\" " + mapping,
        {{"g.tga", kGrid}});
    const Rgb colour = value(d, material_of(d).reflectance, {0.1f, 0.9f}, p);
    const auto step = [](float linear) {  // 80, 160 and 240 of 255 in sRGB
        return linear < 0.01f ? 0 : linear < 0.2f ? 1 : linear < 0.6f ? 2 : 3;
    };
    return {step(colour.r), step(colour.g)};
}

TEST(TextureMapping, PlanarSphericalCylindrical) {
    Rng rng({2});
    const auto column = [](double s) { return int(std::floor((s - std::floor(s)) * 4)); };
    for (int i = 0; i < 300; ++i) {
        const float x = rng.uniform() * 6 - 3, y = rng.uniform() * 6 - 3;
        const Vec3 p{x, y, rng.uniform() * 6 - 3}, q = in_place(p);
        const auto expect = [&](const std::string& mapping, double s, double t) {
            const auto edge = [](double v) { return std::fabs(v * 4 - std::round(v * 4)) < 1e-3; };
            if (edge(s) || edge(t)) return;  // Rounding decides.
            EXPECT_EQ(texel_at(mapping, p), (std::array{column(s), column(t)})) << mapping << ' ' << s << ' ' << t;
        };
        expect("\"string mapping\" \"planar\"", double(q.x), double(q.y));
        expect(
            "\"string mapping\" \"planar\" \"vector3 v1\" [0 0.5 1] \"vector3 v2\" [2 0 -1] \"float udelta\" 0.3 \"float vdelta\" "
            "-0.2",
            0.3 + 0.5 * double(q.y) + double(q.z), -0.2 + 2 * double(q.x) - double(q.z));
        const double r = std::sqrt(double(q.x) * q.x + double(q.y) * q.y + double(q.z) * q.z);
        const double phi = std::atan2(double(q.y), double(q.x));
        expect("\"string mapping\" \"spherical\"", std::acos(double(q.z) / r) / M_PI,
               (phi < 0 ? phi + 2 * M_PI : phi) / (2 * M_PI));
        expect("\"string mapping\" \"cylindrical\"", (M_PI + phi) / (2 * M_PI), double(q.z));
    }
    const std::string start = "Texture \"t\" \"float\" \"dots\" \"string mapping\" ";
    expect_error(start + "\"cubic\"", {"scene.pbrt:3", "mapping", "spherical", "planar"});
    expect_error(start + "\"planar\" \"vector3 v1\" [1 0 0 0 1 0]", {"three numbers"});
    expect_error(start + "\"spherical\" \"float uscale\" 2", {"uscale"});
}

TEST(ProceduralTexture, Errors) {
    const std::string start = "Texture \"t\" \"float\" ";
    expect_error(start + "\"marble\"", {"scene.pbrt:3", "spectrum texture only"});
    expect_error("Texture \"t\" \"spectrum\" \"fbm\"", {"scene.pbrt:3", "float texture only"});
    expect_error("Texture \"t\" \"spectrum\" \"wrinkled\"", {"float texture only"});
    expect_error("Texture \"t\" \"spectrum\" \"windy\"", {"float texture only"});
    expect_error(start + "\"fbm\" \"integer octaves\" -1", {"octaves", "between 0 and 32"});
    expect_error(start + "\"fbm\" \"integer octaves\" 33", {"octaves"});
    expect_error(start + "\"wrinkled\" \"float roughness\" -0.5", {"roughness", "between 0 and 4"});
    expect_error(start + "\"windy\" \"integer octaves\" 3", {"octaves"});
    expect_error("Texture \"t\" \"spectrum\" \"marble\" \"float octaves\" 3", {"octaves"});
    expect_error(start + "\"ptex\"", {"ptex", "not supported"});
    expect_error(start + "\"dots\" \"texture inside\" \"t\"", {"refers to itself"});
    expect_error("ActiveTransform EndTime Translate 1 0 0 " + start + "\"fbm\"", {"scene.pbrt:3", "moves"});
    // Who does not ask for the place does not mind.
    EXPECT_EQ(world("ActiveTransform EndTime Translate 1 0 0 " + start + "\"checkerboard\"").texture_spaces.size(), 0u);
}

TEST(ProceduralTexture, StaysWithinItsRange) {
    import::MemorySource source(testing::FileMap{});
    import::Context context(&source, {});
    context.scene.texture_spaces.push_back(Mat4());
    Rng rng({4});
    const auto number = [&](float value) { return import::constant_texture(&context, Rgb(value)); };
    std::vector<TextureId> ids;
    for (const TextureKind kind :
         {TextureKind::kFractal, TextureKind::kWrinkled, TextureKind::kWindy, TextureKind::kDots, TextureKind::kSolidCheckerboard})
        for (int i = 0; i < 6; ++i) {
            TextureNode node;
            node.kind = kind;
            node.space = 0;
            node.octaves = uint8_t(rng.uniform() * 8);
            node.omega = rng.uniform() * 1.5f;
            node.mapping = TextureMapping::kPlanar;
            node.a = number(rng.uniform()), node.b = number(-rng.uniform());
            ids.push_back(import::add_node(&context, node));
            TextureNode twice;
            twice.kind = TextureKind::kScale;
            twice.a = ids.back(), twice.b = number(-2);
            ids.push_back(import::add_node(&context, twice));
        }
    for (const TextureId id : ids) {
        const import::TextureRange range = context.texture_ranges[size_t(id)];
        double least = HUGE_VAL, most = -HUGE_VAL;
        for (int i = 0; i < 20000; ++i) {
            const float x = rng.uniform() * 100, y = rng.uniform() * 100;
            const double v = double(value(context.scene, id, {}, {x, y, rng.uniform() * 100}).r);
            least = std::min(least, v), most = std::max(most, v);
        }
        EXPECT_GE(least, range.least);
        EXPECT_LE(most, range.most);
    }
    // What a look-up costs counts octaves.
    EXPECT_GT(context.texture_costs[size_t(ids[24])].visits, 9);
    std::string many = "Texture \"t0\" \"float\" \"fbm\" \"integer octaves\" 32\n";
    for (int i = 1; i <= 8; ++i) {
        const std::string below = "\"t" + std::to_string(i - 1) + "\"";
        many += "Texture \"t" + std::to_string(i) + "\" \"float\" \"dots\" \"texture inside\" " + below + " \"texture outside\" " +
                below + "\n";
    }
    expect_error(many, {"4096 look-ups"});
}

/// Alpha and colour of a shape are those of the place in the world, in an instance too, whatever ray finds it.
TEST(ProceduralTexture, InstancesShowTheWorldsTexture) {
    SceneDescription d = world(
        "Scale 0.4 0.4 0.4 Texture \"a\" \"float\" \"checkerboard\" \"integer dimension\" 3\n"
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"integer dimension\" 3 \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0]\n"
        "Identity Material \"diffuse\" \"texture reflectance\" \"c\"\n"
        "ObjectBegin \"o\" Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] \"integer indices\" [0 1 2 0 2 3]\n"
        "\"texture alpha\" \"a\"\n"
        "Translate 0 0 1 Shape \"sphere\" \"float radius\" 0.7 \"texture alpha\" \"a\" ObjectEnd\n"
        "Translate 0.1 0.2 3 Rotate 20 1 2 3 Scale 1.5 1 0.7 ObjectInstance \"o\" Translate 0 0 5 ObjectInstance \"o\"");
    d.camera.camera_to_world = Mat4();
    Result<std::unique_ptr<Scene>> scene = Scene::build(std::move(d), {8, 8});
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    Rng rng({6});
    int hits = 0, blocked = 0;
    for (int i = 0; i < 20000; ++i) {
        const Vec3 o{rng.uniform() * 3 - 1.5f, rng.uniform() * 3 - 1.5f, i % 2 == 0 ? -1.0f : 15.0f};
        const Vec3 towards{rng.uniform() * 3 - 1.5f, rng.uniform() * 3 - 1.5f, 7 + 2 * rng.uniform()};
        const Vec3 dir = normalize(towards - o);
        SurfacePoint point;
        if (!(*scene)->intersect(o, dir, &point)) continue;
        ++hits;
        const Vec3 q = point.p / 0.4f;
        const auto edge = [](float v) { return std::fabs(v - std::round(v)) < 1e-3f; };
        if (edge(q.x) || edge(q.y) || edge(q.z)) continue;
        // Only where the alpha is 1 can it be hit; there the other checkerboard is red.
        EXPECT_EQ(int(std::floor(q.x) + std::floor(q.y) + std::floor(q.z)) & 1, 0) << q.x << ' ' << q.y << ' ' << q.z;
        EXPECT_EQ((*scene)->bsdf_at(point).albedo(), Rgb(1, 0, 0));
        blocked += (*scene)->occluded(o, dir, 0, point.p + dir * 0.01f);
    }
    EXPECT_GT(hits, 3000);
    EXPECT_GT(blocked, hits * 9 / 10);
}

}  // namespace
}  // namespace lightloom
