#include "common/work/identity.h"

#include "common/film/partial_exr.h"
#include "common/scene/scene.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"

namespace lightloom {
namespace {

constexpr int kGoldenSize = 32;

struct GoldenBuilder {
    SceneDescription scene;

    TextureId constant(Rgb value) {
        scene.textures.push_back({.kind = TextureKind::kConstant, .value = value});
        return TextureId(scene.textures.size() - 1);
    }
    MaterialId material(Material m) {
        scene.materials.push_back(std::move(m));
        return MaterialId(scene.materials.size() - 1);
    }
    /// A parallelogram from p0 along a and b; its normal is cross(a, b).
    void quad(Vec3 p0, Vec3 a, Vec3 b, MaterialId m, int32_t emission = kNone) {
        TriangleMesh mesh;
        mesh.positions = {p0, p0 + a, p0 + a + b, p0 + b};
        mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        mesh.indices = {0, 1, 2, 0, 2, 3};
        mesh.attributes = {.material = m, .emission = emission, .source = "golden"};
        scene.meshes.push_back(std::move(mesh));
    }
    void sphere(Vec3 centre, float radius, MaterialId m) {
        Sphere s;
        s.centre = centre;
        s.radius = radius;
        s.attributes = {.material = m, .source = "golden"};
        scene.spheres.push_back(std::move(s));
    }
};

}  // namespace

std::string math_profile() {
    return std::string(kTools) + " isa=avx2 x86-64-v3 contract=off";
}

SceneDescription golden_scene() {
    GoldenBuilder g;
    const TextureId white = g.constant(Rgb(0.75f)), red = g.constant({0.7f, 0.2f, 0.15f});
    g.scene.textures.push_back(
        {.kind = TextureKind::kCheckerboard, .a = white, .b = g.constant({0.1f, 0.3f, 0.6f}), .su = 4, .sv = 4});
    const TextureId checks = TextureId(g.scene.textures.size() - 1);
    const TextureId rough = g.constant(Rgb(0.3f)), half = g.constant(Rgb(0.4f));

    const MaterialId wall = g.material({.kind = MaterialKind::kDiffuse, .reflectance = white});
    const MaterialId floor = g.material({.kind = MaterialKind::kDiffuse, .reflectance = checks});
    const MaterialId curtain =
        g.material({.kind = MaterialKind::kDiffuseTransmission, .reflectance = red, .transmittance = half});
    const MaterialId metal = g.material(
        {.kind = MaterialKind::kConductor, .reflectance = white, .roughness_u = rough, .roughness_v = rough});
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

Result<Digest> golden_unit_digest() {
    auto built = Scene::build(golden_scene());
    if (!built.ok()) return built.status();
    const std::shared_ptr<const Scene> scene = std::move(built).value();
    Sha256 hash;
    for (const AlgorithmInfo& algorithm : catalog()) {
        RenderSettings settings{.algorithm = std::string(algorithm.name), .seed = 1, .max_depth = 6};
        // Tables and caches large enough to run every line, small enough for a registration that nobody waits for.
        for (const auto& [name, value] : {std::pair{"training-paths", "2000"}, std::pair{"cache", "500"},
                                          std::pair{"light-subspaces", "40"}, std::pair{"eye-subspaces", "20"}})
            if (has_parameter(algorithm, name)) settings.parameters[name] = value;
        const auto parameters = parse_parameters(algorithm, settings.parameters);
        if (!parameters.ok()) return parameters.status();
        std::shared_ptr<const SubspaceTables> tables;
        if (algorithm.needs_tables) {
            TrainingReport report;
            auto made = make_tables(*scene, settings, {}, &report);
            if (!made.ok()) return made.status();
            const std::string bytes = serialize(*made);
            hash.update(bytes.data(), bytes.size());
            tables = std::make_shared<const SubspaceTables>(std::move(*made));
        }
        const auto renderer = Renderer::create(scene, settings, tables);
        if (!renderer.ok()) return renderer.status();
        const Rect tile{0, 0, kGoldenSize, kGoldenSize};
        const std::vector<WorkUnit> units =
            split_group({0, 0, 4}, {tile}, light_paths_per_pixel(algorithm, *parameters));
        const auto partial = (*renderer)->render(unit_work(units.front()), {});
        if (!partial.ok()) return partial.status();
        const auto encoded = encode_partial(*partial, scene->frame());
        if (!encoded.ok()) return encoded.status();
        hash.update(encoded->descriptor.payload_digest.bytes.data(), encoded->descriptor.payload_digest.bytes.size());
    }
    return hash.finish();
}

Result<BuildIdentity> build_identity() {
    const auto digest = golden_unit_digest();
    if (!digest.ok()) return digest.status();
    return BuildIdentity{kBuildId, math_profile(), *digest};
}

}  // namespace lightloom
