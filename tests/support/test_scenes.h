#pragma once
// The small scenes that the tests of light transport share, each built to exercise one part of it,
// and which algorithms can sample every path of it (the others are left out by construction, never
// by tolerance).

#include <algorithm>
#include <ostream>

#include "tests/support/textured_scenes.h"

namespace lightloom::testing {

/// Whether a camera sub-path can end on one of the lights.
inline bool can_be_hit(const Scene& scene) {
    const auto& emitters = scene.emitters().all();
    return std::any_of(emitters.begin(), emitters.end(), [](const Emitter& e) { return e.can_be_hit(); });
}

inline std::shared_ptr<const Scene> diffuse_box() { return cornell_builder().build(); }

inline std::shared_ptr<const Scene> glass_and_mirror() {
    SceneBuilder b = cornell_builder();
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    Material mirror;
    mirror.kind = MaterialKind::kConductor;
    mirror.reflectance = b.constant({0.9f, 0.8f, 0.7f});
    b.sphere({-0.4f, 0.35f, 0}, 0.35f, b.add(glass));
    b.quad({-0.9f, 0.3f, 0.95f}, {0, 1, 0}, {1.4f, 0, 0}, b.add(mirror));
    return b.build();
}

inline std::shared_ptr<const Scene> rough_and_coated() {
    SceneBuilder b = cornell_builder();
    const TextureId rough = b.constant(Rgb(0.3f)), fine = b.constant(Rgb(0.05f));
    Material coat;
    coat.kind = MaterialKind::kCoatedDiffuse;
    coat.reflectance = b.constant({0.5f, 0.4f, 0.3f});
    coat.roughness_u = coat.roughness_v = rough;
    coat.remap_roughness = false;
    Material smooth_coat = coat;
    smooth_coat.roughness_u = smooth_coat.roughness_v = b.constant(Rgb(0.0f));
    Material metal;
    metal.kind = MaterialKind::kConductor;
    metal.reflectance = b.constant({0.9f, 0.8f, 0.7f});
    metal.roughness_u = metal.roughness_v = fine;
    Material frosted;
    frosted.kind = MaterialKind::kDielectric;
    frosted.ior = 1.5f;
    frosted.roughness_u = frosted.roughness_v = rough;
    frosted.remap_roughness = false;
    b.sphere({-0.4f, 0.35f, 0}, 0.35f, b.add(metal));
    b.sphere({-0.2f, 1.3f, 0.3f}, 0.3f, b.add(frosted));
    b.description().meshes[0].attributes.material = b.add(coat);
    b.description().meshes[5].attributes.material = b.add(smooth_coat);
    return b.build();
}

inline std::shared_ptr<const Scene> delta_lights() {
    SceneBuilder b = cornell_builder();
    b.description().meshes.erase(b.description().meshes.begin() + 1);  // open the ceiling to the distant light
    b.description().point_lights.push_back({{0.5f, 1.5f, -0.5f}, {1, 2, 3}});
    SpotLight spot;
    spot.position = {-0.5f, 1.8f, 0};
    spot.axes = Frame(normalize(Vec3{0.3f, -1, 0.2f}));
    spot.intensity = {5, 4, 3};
    spot.total_height = 0.3f, spot.falloff_height = 0.1f;
    b.description().spot_lights.push_back(spot);
    b.description().distant_lights.push_back({normalize(Vec3{0.2f, -1, 0.1f}), {2, 2, 2}});
    Image picture;
    picture.width = picture.height = 4;
    for (int i = 0; i < 16; ++i)
        picture.floats.insert(picture.floats.end(), {float(i % 3), 0.5f + 0.5f * float(i % 2), i == 5 ? 6.0f : 0.5f});
    b.description().images.push_back(picture);
    ImageLight projector, lamp;
    projector.position = {-0.7f, 1.5f, -0.6f};
    projector.light_to_world = *inverse(*look_at(projector.position, {0.3f, 0.5f, 0.8f}, {0, 1, 0}));
    projector.half_width = 0.4f, projector.half_height = 0.5f;
    projector.intensity = {4, 4, 3};
    lamp.kind = ImageLight::Kind::kGoniometric;
    lamp.position = {-0.2f, 1.2f, 0.5f};
    lamp.light_to_world = rotation(40, 1, 1, 0);
    lamp.intensity = {0.5f, 0.4f, 0.6f};
    projector.image = lamp.image = 0;
    b.description().image_lights = {projector, lamp};
    return b.build();
}

inline std::shared_ptr<const Scene> environment_lit() {
    SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.6f));
    b.quad({-2, 0, -2}, {0, 0, 4}, {4, 0, 0}, white);
    b.sphere({0, 0.5f, 0}, 0.5f, white);
    Image map;
    map.width = map.height = 8;
    for (int i = 0; i < 64; ++i) map.floats.insert(map.floats.end(), {0.1f * float(i % 7), 0.3f, float(i == 20) * 30});
    b.description().images.push_back(map);
    InfiniteLight image_light, constant_light;
    image_light.image = 0;
    image_light.light_to_world = rotation(40, 1, 1, 0);
    constant_light.radiance = {0.2f, 0.3f, 0.1f};
    b.description().infinite_lights = {image_light, constant_light};
    b.quad({-1, 1.5f, 0}, {0.5f, 0, 0}, {0, 0, 0.5f}, white, b.emission({4, 4, 4}, true));
    b.look({0, 1.5f, -3}, {0, 0.4f, 0}, 50);
    return b.build();
}

inline std::shared_ptr<const Scene> smooth_normals_and_lens() {
    SceneBuilder b = cornell_builder();
    // A coarse pyramid with normals far from the geometric ones, one side of it emitting.
    TriangleMesh mesh;
    mesh.positions = {{-0.3f, 0.01f, -0.3f}, {0.3f, 0.01f, -0.3f}, {0.3f, 0.01f, 0.3f}, {-0.3f, 0.01f, 0.3f}, {0, 0.6f, 0}};
    for (const Vec3& p : mesh.positions) mesh.normals.push_back(normalize(p - Vec3{0, -0.1f, 0}));
    mesh.indices = {1, 0, 4, 2, 1, 4, 3, 2, 4, 0, 3, 4};
    mesh.attributes = {b.diffuse({0.4f, 0.6f, 0.8f}), kNone, kNone, false, "pyramid"};
    TriangleMesh lamp = mesh;
    for (Vec3& p : lamp.positions) p = p * 0.4f + Vec3{0.5f, 1.2f, -0.2f};
    lamp.attributes.emission = b.emission({6, 5, 4});
    b.description().meshes.push_back(mesh);
    b.description().meshes.push_back(lamp);
    b.sphere({-0.6f, 0.2f, 0.4f}, 0.2f, b.diffuse({0.3f, 0.3f, 0.3f}), b.emission({2, 2, 3}));
    b.description().camera.lens_radius = 0.03f;
    b.description().camera.focal_distance = 1.2f;
    return b.build();
}

/// No Dirac lobe anywhere: every algorithm samples every path.
inline std::shared_ptr<const Scene> glossy() {
    SceneBuilder b = cornell_builder();
    const TextureId rough = b.constant(Rgb(0.3f));
    Material coat;
    coat.kind = MaterialKind::kCoatedDiffuse;
    coat.reflectance = b.constant({0.5f, 0.4f, 0.3f});
    coat.roughness_u = coat.roughness_v = rough;
    coat.remap_roughness = false;
    Material metal;
    metal.kind = MaterialKind::kConductor;
    metal.reflectance = b.constant({0.9f, 0.8f, 0.7f});
    metal.roughness_u = b.constant(Rgb(0.2f));
    metal.roughness_v = b.constant(Rgb(0.4f));
    metal.remap_roughness = false;
    Material frosted;
    frosted.kind = MaterialKind::kDielectric;
    frosted.ior = 1.5f;
    frosted.roughness_u = frosted.roughness_v = rough;
    frosted.remap_roughness = false;
    b.sphere({-0.4f, 0.35f, 0}, 0.35f, b.add(metal));
    b.sphere({-0.2f, 1.3f, 0.3f}, 0.3f, b.add(frosted));
    b.description().meshes[0].attributes.material = b.add(coat);
    return b.build();
}

/// Spheres as lights: one seen from outside (next event by its cone), and the room itself, a sphere
/// that shines inwards.
inline std::shared_ptr<const Scene> spherical_lights() {
    SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.6f));
    b.sphere({0, 1, 0}, 3, white, b.emission({0.2f, 0.3f, 0.4f})).attributes.flip_normal = true;
    b.sphere({-0.6f, 0.7f, 0.2f}, 0.25f, b.diffuse({0.5f, 0.2f, 0.2f}), b.emission({9, 8, 6}));
    b.quad({-1.5f, 0, -1.5f}, {0, 0, 3}, {3, 0, 0}, white);
    b.sphere({0.4f, 0.4f, 0.3f}, 0.4f, white);
    b.look({0, 1.2f, -2}, {0, 0.6f, 0}, 60);
    return b.build();
}

/// Lamps that no ray meets, hanging in front of the camera: a square that shines down, and a sphere that shines to both
/// sides and has a ball inside of it. Lamps whose light an image gives: a screen on the wall, a sphere, and a square
/// that no ray meets. The camera has parallel rays that start in the middle of the box.
inline std::shared_ptr<const Scene> hidden_and_pictured_lamps() {
    SceneBuilder b = cornell_builder();
    b.description().emissions[0].radiance = {2, 2, 3};
    const MaterialId white = b.diffuse(Rgb(0.5f));
    b.quad({-0.2f, 1.3f, -0.5f}, {0.5f, 0, 0}, {0, 0.1f, 0.5f}, white, b.emission({4, 3, 2}));
    b.hide_quad();
    b.sphere({0.4f, 1.2f, 0.3f}, 0.3f, white, b.emission({2, 3, 1}, true));
    b.hide_sphere();
    b.sphere({0.4f, 1.15f, 0.3f}, 0.12f, b.diffuse({0.6f, 0.3f, 0.4f}));

    Image picture;
    picture.width = 5, picture.height = 4;
    for (int i = 0; i < 20; ++i)
        picture.floats.insert(picture.floats.end(), {0.5f * float(i % 3), 0.2f + 0.2f * float(i / 5), float(i == 7) * 4});
    b.description().images.push_back(picture);
    const auto emission = [&](const Rgb& radiance, bool two_sided) {
        const int32_t id = b.emission(radiance, two_sided);
        b.description().emissions[size_t(id)].image = 0;
        return id;
    };
    b.quad({-0.9f, 0.4f, 0.9f}, {0, 0.9f, 0.05f}, {0.8f, 0, 0}, white, emission({3, 4, 5}, false)).uvs = {
        {0, 0}, {0, 1}, {1, 1}, {1, 0}};
    b.sphere({-0.5f, 1.1f, 0.2f}, 0.2f, white, emission({4, 3, 5}, false)).orientation = Frame(normalize(Vec3{1, 2, -1}));
    b.quad({0.1f, 0.7f, -0.3f}, {0.5f, 0, 0}, {0, 0.2f, 0.5f}, white, emission({3, 2, 3}, true));
    b.hide_quad();
    CameraDescription& camera = b.description().camera;
    camera.camera_to_world = *inverse(*look_at({0.1f, 1.1f, -0.6f}, {0, 0.8f, 1}, {0, 1, 0})) * scaling(0.8, 0.8, 0.8);
    camera.kind = CameraKind::kOrthographic;
    return b.build();
}

/// Diffuse surfaces inside smooth glass: a light sub-path is refracted on its way in and can be connected afterwards,
/// so that the throughput of light prefixes must include the effect of a Dirac refraction.
inline std::shared_ptr<const Scene> spheres_in_glass() {
    SceneBuilder b = empty_box_builder();
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    b.sphere({0.02f, 1, 0.26f}, 0.68f, b.add(glass));
    b.sphere({-0.2f, 0.95f, 0.2f}, 0.19f, b.diffuse({0.8f, 0.6f, 0.3f}));
    b.sphere({0.22f, 0.95f, 0.3f}, 0.19f, b.diffuse({0.4f, 0.7f, 0.8f}));
    b.quad({-0.4f, 0.75f, -0.15f}, {0, 0, 0.8f}, {0.8f, 0, 0}, b.diffuse({0.7f, 0.7f, 0.6f}));
    return b.build();
}

/// Mixed materials (of two smooth kinds; of a Dirac and a smooth kind, one mix inside another) and a pane of thin glass.
inline std::shared_ptr<const Scene> mixes_and_pane() {
    SceneBuilder b = empty_box_builder();
    Material metal, mirror, thin;
    metal.kind = mirror.kind = MaterialKind::kConductor;
    metal.reflectance = b.constant({0.9f, 0.7f, 0.4f}), mirror.reflectance = b.constant({0.8f, 0.9f, 0.9f});
    metal.roughness_u = metal.roughness_v = b.constant(Rgb(0.3f));
    metal.remap_roughness = false;
    thin.kind = MaterialKind::kThinDielectric;
    thin.ior = 1.5f;
    const auto mix = [&](MaterialId first, MaterialId second, float amount) {
        Material m;
        m.kind = MaterialKind::kMix;
        m.mix_a = first, m.mix_b = second, m.mix_amount = b.constant(Rgb(amount));
        return b.add(m);
    };
    const MaterialId worn = mix(b.add(metal), b.diffuse({0.3f, 0.5f, 0.6f}), 0.7f);
    b.description().meshes[0].attributes.material = worn;
    b.sphere({0.4f, 0.4f, 0.3f}, 0.4f, mix(b.add(mirror), worn, 0.6f));
    b.quad({-0.9f, 0.1f, 0.5f}, {0.9f, 0.1f, -0.3f}, {0, 1.2f, 0.1f}, b.add(thin));
    return b.build();
}

/// Surfaces of fractional opacity: a veil that is the same everywhere, a sphere, and a screen with a checkered opacity.
/// Every ray decides anew whether it passes. `veil` scales the opacity of all three: 0 takes them away.
inline std::shared_ptr<const Scene> translucent(float veil) {
    SceneBuilder b = cornell_builder();
    const auto opacity = [&](float value) { return b.constant(Rgb(value * veil)); };
    TextureNode checks;
    checks.kind = TextureKind::kCheckerboard;
    checks.a = opacity(0.8f), checks.b = opacity(0.3f);
    checks.su = checks.sv = 4;
    b.description().textures.push_back(checks);
    const TextureId checkered = TextureId(b.description().textures.size()) - 1;
    b.quad({-0.9f, 1.4f, -0.5f}, {1.3f, 0, 0}, {0, 0, 1.2f}, b.diffuse({0.7f, 0.5f, 0.3f})).attributes.alpha = opacity(0.5f);
    b.quad({-0.8f, 0.1f, -0.2f}, {1.2f, 0, 0.2f}, {0, 1, 0}, b.diffuse({0.4f, 0.7f, 0.5f})).attributes.alpha = checkered;
    b.sphere({0.5f, 1.2f, 0.2f}, 0.3f, b.diffuse({0.5f, 0.4f, 0.8f})).attributes.alpha = opacity(0.6f);
    return b.build();
}
inline std::shared_ptr<const Scene> fractional_opacity() { return translucent(1); }
inline std::shared_ptr<const Scene> fractional_opacity_taken_away() { return translucent(0); }

/// A caustic: a point light behind a glass ball and beside a mirror, neither of them seen by the camera. Next event
/// estimation and hits never find it, but light sub-paths do.
inline std::shared_ptr<const Scene> caustic_of_a_point_light() {
    SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.7f));
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    Material mirror;
    mirror.kind = MaterialKind::kConductor;
    mirror.reflectance = b.constant({0.9f, 0.8f, 0.7f});
    b.quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, white);
    b.quad({-1, 0, 1}, {0, 1, 0}, {2, 0, 0}, white);
    b.sphere({0.2f, 2.2f, 0}, 0.4f, b.add(glass));
    b.quad({-1, 2, -1}, {0, 1.5f, 0}, {0, 0, 2}, b.add(mirror));
    b.description().point_lights.push_back({{0.2f, 3.2f, 0}, {8, 8, 8}});
    b.look({0, 1.2f, -1.6f}, {0, 0.3f, 0.4f}, 55);
    return b.build();
}

/// Diffuse surfaces that do not touch anywhere: 1 / d^2 is bounded between any two of them, so that every technique has
/// a finite variance even alone, without weights.
inline SceneBuilder apart_builder() {
    SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.7f)), red = b.diffuse({0.7f, 0.2f, 0.1f});
    b.quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, white);           // floor
    b.quad({-1, 0.5f, 1.5f}, {0, 1.5f, 0}, {2, 0, 0}, red);     // back
    b.quad({-1.5f, 0.5f, -1}, {0, 1.5f, 0}, {0, 0, 2}, white);  // side
    b.sphere({0.3f, 0.8f, 0.3f}, 0.4f, b.diffuse({0.3f, 0.5f, 0.7f}));
    b.look({0.4f, 1.2f, -3}, {-0.1f, 0.8f, 0}, 45);
    return b;
}

inline std::shared_ptr<const Scene> apart_with_lamp() {
    SceneBuilder b = apart_builder();
    b.quad({-0.7f, 2.5f, -0.7f}, {1.4f, 0, 0}, {0, 0, 1.4f}, b.diffuse(Rgb(0.2f)), b.emission({6, 5, 4}));
    return b.build();
}

inline std::shared_ptr<const Scene> apart_with_sky() {
    SceneBuilder b = apart_builder();
    InfiniteLight sky;
    sky.radiance = {0.5f, 0.7f, 1};
    b.description().infinite_lights.push_back(sky);
    b.sphere({-0.6f, 1.2f, -0.2f}, 0.2f, b.diffuse(Rgb(0.2f)), b.emission({4, 4, 3}));
    return b.build();
}

struct NamedScene {
    const char* name;
    std::shared_ptr<const Scene> (*make)();
    /// The algorithms that sample every path of the scene, space-separated.
    const char* complete;
    /// `path` meets caustics here only by rare, bright hits: the variance of its samples is not the true one, and only
    /// paths too short for caustics (k <= 2) can be tested.
    bool caustics = false;
    /// The same scene without its surfaces of fractional opacity. Whether a ray passes them is decided anew for every
    /// ray and does not concern the weights. Therefore the other techniques of a path that came through are rebuilt
    /// where nothing is in their way.
    std::shared_ptr<const Scene> (*unveiled)() = nullptr;

    /// The scene in which paths of `scene`, which make() made, are rebuilt.
    std::shared_ptr<const Scene> stage(const std::shared_ptr<const Scene>& scene) const {
        return unveiled != nullptr ? unveiled() : scene;
    }
};

/// How test runners show it.
inline void PrintTo(const NamedScene& scene, std::ostream* out) { *out << scene.name; }

inline constexpr NamedScene kScenes[] = {
    {"diffuse_box", diffuse_box, "path light bdpt"},
    {"glossy", glossy, "path light bdpt"},
    {"textured_and_two_sided", textured_and_two_sided, "path light bdpt"},
    {"instances_and_cutouts", instances_and_cutouts, "path light bdpt"},
    {"textures_in_space", textures_in_space, "path light bdpt"},
    {"bumped", bumped, "path light bdpt"},
    {"smooth_normals_and_lens", smooth_normals_and_lens, "path light bdpt"},
    {"spherical_lights", spherical_lights, "path light bdpt"},
    {"hidden_and_pictured_lamps", hidden_and_pictured_lamps, "path light bdpt"},
    {"environment_lit", environment_lit, "path light bdpt"},
    {"delta_lights", delta_lights, "path light bdpt"},
    {"glass_and_mirror", glass_and_mirror, "path bdpt"},        // light: what is seen through glass is missing
    {"rough_and_coated", rough_and_coated, "path bdpt", true},  // light: and what a smooth coat reflects
    {"spheres_in_glass", spheres_in_glass, "path bdpt", true},
    {"mixes_and_pane", mixes_and_pane, "path bdpt"},
    {"fractional_opacity", fractional_opacity, "path light bdpt", false, fractional_opacity_taken_away},
    {"caustic_of_a_point_light", caustic_of_a_point_light, "light bdpt"},  // path: the caustic is missing
};

}  // namespace lightloom::testing
