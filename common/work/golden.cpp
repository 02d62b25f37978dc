#include "common/work/golden.h"

#include <atomic>

#include "common/core/transform.h"
#include "common/film/partial_exr.h"
#include "common/scene/scene.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"
#include "common/work/job.h"

namespace lightloom {
namespace {

constexpr int kGoldenSize = 32;

struct GoldenBuilder {
    SceneDescription scene;

    TextureId texture(const TextureNode& t) {
        scene.textures.push_back(t);
        return TextureId(scene.textures.size() - 1);
    }
    TextureId constant(Rgb value) { return texture({.kind = TextureKind::kConstant, .value = value}); }
    MaterialId material(Material m) {
        scene.materials.push_back(std::move(m));
        return MaterialId(scene.materials.size() - 1);
    }
    /// Adds an image with value(x, y, c) in every texel.
    template <class Value>
    int32_t image(int size, int channels, const Value& value) {
        Image i;
        i.width = i.height = size;
        i.channels = channels;
        i.name = "golden";
        for (int y = 0; y < size; ++y)
            for (int x = 0; x < size; ++x)
                for (int c = 0; c < channels; ++c) i.floats.push_back(value(x, y, c));
        scene.images.push_back(std::move(i));
        return int32_t(scene.images.size() - 1);
    }
    /// Stores an image as 8-bit files do: as codes, with a table of the value of each code.
    void code(int32_t index) {
        Image& i = scene.images[size_t(index)];
        for (size_t c = 0; c < i.decode.size(); ++c) i.decode[c] = float(c * c) / (255.0f * 255.0f);
        for (const float value : i.floats) i.bytes.push_back(uint8_t(value * 255));
        i.floats.clear();
    }
    /// A parallelogram from p0 along a and b; its normal is cross(a, b).
    static TriangleMesh parallelogram(Vec3 p0, Vec3 a, Vec3 b, MaterialId m, int32_t emission = kNone) {
        TriangleMesh mesh;
        mesh.positions = {p0, p0 + a, p0 + a + b, p0 + b};
        mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        mesh.indices = {0, 1, 2, 0, 2, 3};
        mesh.attributes = {.material = m, .emission = emission, .source = "golden"};
        return mesh;
    }
    void quad(Vec3 p0, Vec3 a, Vec3 b, MaterialId m, int32_t emission = kNone) {
        scene.meshes.push_back(parallelogram(p0, a, b, m, emission));
    }
    void sphere(Vec3 centre, float radius, MaterialId m, int32_t emission = kNone) {
        Sphere s;
        s.centre = centre;
        s.radius = radius;
        s.attributes = {.material = m, .emission = emission, .source = "golden"};
        scene.spheres.push_back(std::move(s));
    }
};

}  // namespace

SceneDescription golden_scene() {
    GoldenBuilder g;
    const TextureId white = g.constant(Rgb(0.75f)), red = g.constant({0.7f, 0.2f, 0.15f});
    const TextureId checks =
        g.texture({.kind = TextureKind::kCheckerboard, .a = white, .b = g.constant({0.1f, 0.3f, 0.6f}), .su = 4, .sv = 4});
    const TextureId rough = g.constant(Rgb(0.3f)), half = g.constant(Rgb(0.4f));

    const MaterialId wall = g.material({.kind = MaterialKind::kDiffuse, .reflectance = white});
    const MaterialId floor = g.material({.kind = MaterialKind::kDiffuse, .reflectance = checks});
    const MaterialId curtain = g.material({.kind = MaterialKind::kDiffuseTransmission, .reflectance = red, .transmittance = half});
    const MaterialId metal =
        g.material({.kind = MaterialKind::kConductor, .reflectance = white, .roughness_u = rough, .roughness_v = rough});
    const MaterialId glass = g.material({.kind = MaterialKind::kDielectric, .ior = 1.5f});

    g.scene.emissions.push_back({.radiance = {12, 11, 9}});
    g.quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, floor);
    g.quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, wall);
    g.quad({-1, 0, 1}, {0, 2, 0}, {2, 0, 0}, wall);
    g.quad({-1, 0, -1}, {0, 2, 0}, {0, 0, 2}, wall);
    g.quad({1, 0, -1}, {0, 0, 2}, {0, 2, 0}, wall);
    g.quad({0.1f, 0.3f, -0.2f}, {0.6f, 0, 0.3f}, {0, 1.2f, 0}, curtain);
    g.quad({-0.4f, 1.95f, -0.4f}, {0.8f, 0, 0}, {0, 0, 0.8f}, wall, 0);
    g.sphere({-0.45f, 0.4f, 0.3f}, 0.4f, metal);
    g.sphere({0.35f, 0.3f, -0.45f}, 0.3f, glass);
    g.scene.camera.camera_to_world = *inverse(*look_at({0, 1, -3}, {0, 0.95f, 0}, {0, 1, 0}));
    g.scene.camera.fov_degrees = 50;
    g.scene.film.width = g.scene.film.height = kGoldenSize;
    g.scene.max_depth = 6;
    return std::move(g.scene);
}

SceneDescription golden_courtyard() {
    GoldenBuilder g;
    const TextureId white = g.constant(Rgb(0.7f)), tenth = g.constant(Rgb(0.1f)), third = g.constant(Rgb(0.3f));
    const auto texel = [](int x, int y, int c) { return 0.1f + 0.1f * float((3 * x + 5 * y + 7 * c) % 8); };
    const TextureId picture =
        g.texture({.kind = TextureKind::kImage, .image = g.image(8, 3, texel), .scale = 0.9f, .su = 3, .sv = 2});
    const int32_t coded = g.image(4, 1, texel);
    g.code(coded);
    const TextureId grille =
        g.texture({.kind = TextureKind::kImage, .image = coded, .wrap = WrapMode::kClamp, .nearest = true, .invert = true});
    const TextureId label = g.texture({.kind = TextureKind::kImage, .image = coded, .wrap = WrapMode::kBlack, .su = 2, .sv = 2});
    const TextureId blend =
        g.texture({.kind = TextureKind::kMix, .a = picture, .b = g.constant({0.2f, 0.5f, 0.3f}), .amount = third});
    const TextureId shade = g.texture({.kind = TextureKind::kScale, .a = blend, .b = white});

    const MaterialId ground = g.material({.kind = MaterialKind::kDiffuse, .reflectance = shade});
    const MaterialId lacquer =
        g.material({.kind = MaterialKind::kCoatedDiffuse, .reflectance = picture, .roughness_u = third, .roughness_v = tenth});
    const MaterialId varnish = g.material({.kind = MaterialKind::kCoatedConductor,
                                           .eta = g.constant({0.2f, 0.9f, 1.1f}),
                                           .k = g.constant({3.9f, 2.4f, 2.2f}),
                                           .roughness_u = tenth,
                                           .roughness_v = tenth,
                                           .base_roughness_u = third,
                                           .base_roughness_v = tenth});
    const MaterialId poster = g.material({.kind = MaterialKind::kDiffuse, .reflectance = label});
    const MaterialId copper = g.material({.kind = MaterialKind::kConductor,
                                          .eta = g.constant({0.2f, 0.9f, 1.1f}),
                                          .k = g.constant({3.9f, 2.4f, 2.2f}),
                                          .roughness_u = third,
                                          .roughness_v = tenth,
                                          .remap_roughness = false});
    const MaterialId frosted =
        g.material({.kind = MaterialKind::kDielectric, .roughness_u = tenth, .roughness_v = tenth, .ior = 1.4f});
    const MaterialId pane = g.material({.kind = MaterialKind::kThinDielectric, .ior = 1.5f});
    const MaterialId patina = g.material({.kind = MaterialKind::kMix, .mix_a = copper, .mix_b = lacquer, .mix_amount = third});

    g.scene.emissions.push_back({.radiance = {30, 24, 16}});
    g.scene.emissions.push_back({.radiance = {2, 3, 4}, .two_sided = true});
    g.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, ground);
    g.quad({-2, 0, 2}, {0, 2.5f, 0}, {4, 0, 0}, lacquer);
    // These normals differ from the plane's, and one points to the other side.
    g.scene.meshes.back().normals = {normalize(Vec3{-0.3f, 0, -1}), normalize(Vec3{-0.3f, 0.2f, -1}),
                                     normalize(Vec3{0.3f, 0.2f, -1}), normalize(Vec3{0.3f, 0, -1})};
    g.quad({-1.2f, 0.1f, 1.6f}, {0.8f, 0, 0}, {0, 0.8f, 0.1f}, poster);
    g.scene.meshes.back().attributes.flip_normal = true;
    g.quad({0.6f, 0, -0.3f}, {0.8f, 0, 0.4f}, {0, 1.4f, 0}, pane);
    g.quad({-1.6f, 0.4f, 0.2f}, {0, 1, 0}, {0.3f, 0, 0.8f}, ground, 1);
    g.sphere({-0.7f, 0.45f, 0}, 0.45f, varnish);
    g.sphere({-0.1f, 1.3f, 0.9f}, 0.3f, ground);
    g.scene.spheres.back().orientation = Frame(normalize(Vec3{0.5f, 1, 0.3f}));
    g.sphere({0.3f, 0.3f, -0.6f}, 0.3f, frosted);
    g.sphere({0.9f, 1.8f, 0.6f}, 0.15f, ground, 0);
    g.scene.objects.push_back({.name = "screen", .meshes = {}, .spheres = {}});
    g.scene.objects[0].meshes.push_back(GoldenBuilder::parallelogram({0, 0, 0}, {0.7f, 0, 0}, {0, 0.9f, 0}, patina));
    g.scene.objects[0].meshes[0].attributes.alpha = grille;
    g.scene.instances.push_back({0, translation(-0.2, 0, 0.8) * rotation(25, 0, 1, 0), "golden"});
    g.scene.instances.push_back({0, translation(0.5, 0.1, 1.1) * scaling(1.2, 0.8, 1), "golden"});

    g.scene.point_lights.push_back({{-1.2f, 1.9f, -0.9f}, {1.5f, 1.2f, 1}});
    SpotLight spot;
    spot.position = {1.5f, 2, -1};
    spot.axes = Frame(normalize(Vec3{-1.2f, -1.6f, 1}));
    spot.intensity = {6, 6, 5};
    spot.total_height = 0.15f;
    spot.falloff_height = 0.05f;
    g.scene.spot_lights.push_back(spot);
    g.scene.distant_lights.push_back({normalize(Vec3{0.4f, -1, 0.3f}), {0.4f, 0.35f, 0.3f}});
    g.scene.infinite_lights.push_back({rotation(40, 1, 0, 0), Rgb(0.6f), g.image(16, 3, texel)});
    g.scene.infinite_lights.push_back({rotation(0, 1, 0, 0), {0.05f, 0.06f, 0.08f}, kNone});

    g.scene.camera.camera_to_world = *inverse(*look_at({0.2f, 1.2f, -3}, {0, 0.7f, 0}, {0, 1, 0}));
    g.scene.camera.fov_degrees = 55;
    g.scene.camera.lens_radius = 0.03f;
    g.scene.camera.focal_distance = 3;
    g.scene.film.width = g.scene.film.height = kGoldenSize;
    g.scene.max_depth = 6;
    return std::move(g.scene);
}

namespace {

Status hash_units(SceneDescription description, Sha256& hash) {
    auto built = Scene::build(std::move(description));
    if (!built.ok()) return built.status();
    const std::shared_ptr<const Scene> scene = std::move(built).value();
    for (const AlgorithmInfo* row : catalog()) {
        // Training sets and caches are large enough to run every line and small enough to keep registration short.
        auto algorithm = AlgorithmSettings::parse(row->name, {});
        if (!algorithm.ok()) return algorithm.status();
        for (const auto& [name, value] : {std::pair{"training-paths", 2000}, std::pair{"cache", 500},
                                          std::pair{"light-subspaces", 40}, std::pair{"eye-subspaces", 20}})
            if (algorithm->has(name)) *algorithm = algorithm->with(name, value);
        const RenderSettings settings{.algorithm = *algorithm, .seed = 1, .max_depth = 6};
        TrainingReport report;
        const auto tables = make_tables(*scene, settings, {}, &report);
        if (!tables.ok()) return tables.status();
        const std::string bytes = serialize(*tables);
        hash.update(bytes.data(), bytes.size());
        const auto renderer = Renderer::create(scene, settings, *tables);
        if (!renderer.ok()) return renderer.status();
        const Plan plan(scene->frame(), *algorithm);
        const auto partial = (*renderer)->render(plan.units({0, 0, 4}).front().render, {});
        if (!partial.ok()) return partial.status();
        const auto encoded = encode_partial(*partial, scene->frame());
        if (!encoded.ok()) return encoded.status();
        hash.update(encoded->descriptor.payload_digest.bytes.data(), encoded->descriptor.payload_digest.bytes.size());
    }
    return {};
}

std::atomic<uint64_t> digests_made{0};

}  // namespace

uint64_t golden_unit_digests_made() { return digests_made; }

Result<Digest> golden_unit_digest() {
    ++digests_made;
    Sha256 hash;
    LL_RETURN_IF_ERROR(hash_units(golden_scene(), hash));
    LL_RETURN_IF_ERROR(hash_units(golden_courtyard(), hash));
    return hash.finish();
}

}  // namespace lightloom
