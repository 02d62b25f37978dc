#pragma once
// Small scenes whose surfaces have textures, cut-outs, and displacement and normal maps; test_scenes.h lists them.

#include <functional>
#include <memory>

#include "tests/support/small_scenes.h"

namespace lightloom::testing {

/// Textures, a lamp that shines to both sides, and sheets that scatter to both sides.
inline std::shared_ptr<const Scene> textured_and_two_sided() {
    SceneBuilder b = cornell_builder();
    TextureNode checks;
    checks.kind = TextureKind::kCheckerboard;
    checks.a = b.constant({0.8f, 0.7f, 0.2f}), checks.b = b.constant({0.1f, 0.2f, 0.6f});
    checks.su = checks.sv = 6;
    b.description().textures.push_back(checks);
    Material tiles;
    tiles.reflectance = TextureId(b.description().textures.size()) - 1;
    b.description().meshes[0].attributes.material = b.add(tiles);
    Material paper;
    paper.kind = MaterialKind::kDiffuseTransmission;
    paper.reflectance = b.constant({0.3f, 0.4f, 0.3f}), paper.transmittance = b.constant({0.5f, 0.3f, 0.4f});
    const MaterialId sheet = b.add(paper);
    b.quad({-0.9f, 0.9f, -0.2f}, {0.7f, 0.3f, 0}, {0, 0, 0.8f}, sheet);
    b.quad({-0.2f, 1.1f, 0.2f}, {0.5f, 0, 0.1f}, {0.1f, 0.4f, 0}, sheet, b.emission({3, 2, 4}, true));
    return b.build();
}

/// Typical parts of pbrt scenes: an object shown twice (once mirrored and stretched), a curtain with holes from a
/// texture, a floor with an image, a rough coat over metal; the camera sees all around.
inline std::shared_ptr<const Scene> instances_and_cutouts() {
    SceneBuilder b = cornell_builder();
    Image picture;
    picture.width = picture.height = 4;
    for (int i = 0; i < 16; ++i)
        picture.floats.insert(picture.floats.end(), {0.1f + 0.05f * float(i), 0.3f, 0.8f - 0.04f * float(i)});
    b.description().images.push_back(picture);
    TextureNode image;
    image.kind = TextureKind::kImage;
    image.image = 0;
    image.su = image.sv = 2;
    b.description().textures.push_back(image);
    Material carpet;
    carpet.reflectance = TextureId(b.description().textures.size()) - 1;
    b.description().meshes[0].attributes.material = b.add(carpet);

    TextureNode holes;
    holes.kind = TextureKind::kCheckerboard;
    holes.a = b.constant(Rgb(1.0f)), holes.b = b.constant(Rgb(0.0f));
    holes.su = holes.sv = 5;
    b.description().textures.push_back(holes);
    b.quad({-0.9f, 1.3f, -0.4f}, {1.2f, 0, 0}, {0, 0, 0.9f}, b.diffuse({0.5f, 0.6f, 0.3f})).attributes.alpha =
        TextureId(b.description().textures.size()) - 1;

    Material metal;
    metal.kind = MaterialKind::kCoatedConductor;
    metal.eta = b.constant({0.2f, 0.9f, 1.1f}), metal.k = b.constant({3.9f, 2.4f, 2.2f});
    metal.roughness_u = metal.roughness_v = metal.base_roughness_u = metal.base_roughness_v = b.constant(Rgb(0.3f));
    metal.remap_roughness = false;
    b.sphere({-0.55f, 0.45f, -0.25f}, 0.25f, b.add(metal));

    ObjectDefinition object;
    TriangleMesh mesh;
    mesh.positions = {{-0.3f, 0, -0.2f}, {0.3f, 0, -0.2f}, {0.1f, 0, 0.3f}, {0, 0.5f, 0}};
    mesh.indices = {0, 1, 2, 1, 0, 3, 2, 1, 3, 0, 2, 3};
    mesh.attributes.material = b.diffuse({0.7f, 0.4f, 0.3f});
    mesh.attributes.source = "test object";
    object.meshes.push_back(std::move(mesh));
    b.description().objects.push_back(std::move(object));
    b.description().instances.push_back({0, translation(-0.5, 0.2, 0.5), "first"});
    b.description().instances.push_back({0, translation(0.2, 1.0, 0.4) * scaling(-0.8f, 1.5f, 0.6f), "mirrored"});
    b.description().camera.camera_to_world = *inverse(*look_at({0.1f, 1, -0.6f}, {0, 0.8f, 1}, {0.2f, 1, 0}));
    b.description().camera.kind = CameraKind::kEqualArea;
    return b.build();
}

/// Textures that depend on the position in space: marble, a solid checkerboard as a colour and as the cut-outs of an
/// object shown twice (turned and mirrored), noise in a mix of materials and of opacities that are 0 or 1, a planar
/// mapping.
inline std::shared_ptr<const Scene> textures_in_space() {
    SceneBuilder b = cornell_builder();
    auto& d = b.description();
    d.texture_spaces = {scaling(9, 9, 9) * rotation(40, 1, 0, 1), scaling(5, 5, 5) * translation(0.03, 0.02, 0.01)};
    const auto texture = [&](TextureKind kind, int32_t space) {
        TextureNode node;
        node.kind = kind;
        node.space = space;
        node.octaves = 2;
        node.omega = 0.5f;
        node.variation = 0.7f;
        return node;
    };
    const auto add = [&](const TextureNode& node) {
        d.textures.push_back(node);
        return TextureId(d.textures.size()) - 1;
    };
    const auto painted = [&](TextureId reflectance) {
        Material m;
        m.reflectance = reflectance;
        return b.add(m);
    };
    TextureNode blocks = texture(TextureKind::kSolidCheckerboard, 1), holes = blocks;
    blocks.a = b.constant({0.7f, 0.6f, 0.2f}), blocks.b = b.constant({0.1f, 0.3f, 0.6f});
    holes.a = b.constant(Rgb(1.0f)), holes.b = b.constant(Rgb(0.0f));
    TextureNode dots = texture(TextureKind::kDots, 1);
    dots.mapping = TextureMapping::kPlanar;
    dots.a = blocks.a, dots.b = b.constant({0.3f, 0.1f, 0.1f});
    const MaterialId marble = painted(add(texture(TextureKind::kMarble, 0))), block = painted(add(blocks));
    Material metal, mixed;
    metal.kind = MaterialKind::kConductor;
    metal.reflectance = b.constant({0.9f, 0.7f, 0.4f});
    metal.roughness_u = metal.roughness_v = b.constant(Rgb(0.3f));
    metal.remap_roughness = false;
    mixed.kind = MaterialKind::kMix;
    mixed.mix_a = b.add(metal), mixed.mix_b = marble;
    mixed.mix_amount = add(texture(TextureKind::kWrinkled, 0));
    d.meshes[0].attributes.material = marble;
    d.meshes[5].attributes.material = painted(add(dots));
    d.spheres[0].attributes.material = b.add(mixed);

    ObjectDefinition object;
    TriangleMesh mesh;
    mesh.positions = {{-0.3f, 0, -0.2f}, {0.3f, 0, -0.2f}, {0.1f, 0, 0.3f}, {0, 0.5f, 0}};
    mesh.indices = {0, 1, 2, 1, 0, 3, 2, 1, 3, 0, 2, 3};
    mesh.attributes = {block, kNone, add(holes), false, "test object"};
    object.meshes.push_back(std::move(mesh));
    Sphere ball;
    ball.centre = {0, 0.7f, 0};
    ball.radius = 0.2f;
    ball.attributes = object.meshes[0].attributes;
    object.spheres.push_back(std::move(ball));
    d.objects.push_back(std::move(object));
    d.instances.push_back({0, translation(-0.5, 0.2, 0.5), "first"});
    d.instances.push_back({0, translation(0.2, 1.0, 0.4) * rotation(30, 1, 1, 0) * scaling(-0.8f, 1.2f, 0.6f), "mirrored"});
    return b.build();
}

/// The Cornell box without the objects in it.
inline SceneBuilder empty_box_builder() {
    SceneBuilder b = cornell_builder();
    b.description().spheres.clear();
    b.description().meshes.pop_back();
    return b;
}

/// Shading normals tilted by displacement and normal maps: on a floor, half of a mixed wall, a coated sphere turned
/// inside out, a sheet that scatters to both sides, and a mirrored instance with normals of its own. (There is no rough
/// glass, because its total reflection amplifies rounding beyond the tolerance of the weight suites. The tilts are
/// gentle, because where they let rays enter solids, short edges between the faces of a solid amplify it, too.)
inline std::shared_ptr<const Scene> bumped() {
    SceneBuilder b = empty_box_builder();
    SceneDescription& d = b.description();
    const auto image = [&](int channels, const std::function<float(int, int)>& value) {
        Image picture;
        picture.width = picture.height = 4;
        picture.channels = channels;
        for (int i = 0; i < 16; ++i)
            for (int c = 0; c < channels; ++c) picture.floats.push_back(value(i, c));
        d.images.push_back(picture);
        TextureNode node;
        node.kind = TextureKind::kImage;
        node.image = int32_t(d.images.size()) - 1;
        node.su = node.sv = 2;
        d.textures.push_back(node);
        return TextureId(d.textures.size()) - 1;
    };
    const TextureId relief = image(1, [](int i, int) { return 0.012f * float(i * 7 % 16) / 15; });
    const TextureId normals =
        image(3, [](int i, int c) { return c == 2 ? 0.95f : 0.45f + 0.1f * float((i * 5 + c * 3) % 16) / 15; });
    const auto rough = [&](MaterialKind kind, float roughness) {
        Material m;
        m.kind = kind;
        m.reflectance = b.constant({0.8f, 0.6f, 0.5f});
        m.roughness_u = m.base_roughness_u = m.base_roughness_v = b.constant(Rgb(roughness));
        m.roughness_v = b.constant(Rgb(1.5f * roughness));
        m.remap_roughness = false;
        return m;
    };
    Material floor, paper, metal = rough(MaterialKind::kConductor, 0.3f), coat = rough(MaterialKind::kCoatedDiffuse, 0.3f);
    floor.reflectance = b.constant({0.7f, 0.6f, 0.4f});
    floor.displacement = metal.displacement = paper.displacement = relief;
    coat.normal_map = normals;
    paper.kind = MaterialKind::kDiffuseTransmission;
    paper.reflectance = b.constant({0.3f, 0.4f, 0.3f}), paper.transmittance = b.constant({0.5f, 0.3f, 0.4f});
    d.meshes[0].attributes.material = b.add(floor);
    Material half;
    half.kind = MaterialKind::kMix;
    half.mix_a = b.add(metal), half.mix_b = b.diffuse(Rgb(0.5f)), half.mix_amount = b.constant(Rgb(0.4f));
    d.meshes[5].attributes.material = b.add(half);
    b.sphere({0.4f, 0.4f, 0.3f}, 0.4f, b.add(coat)).attributes.flip_normal = true;
    b.quad({-0.9f, 0.9f, -0.2f}, {0.6f, 0.3f, 0}, {0, 0, 0.8f}, b.add(paper));

    ObjectDefinition object;
    TriangleMesh mesh;
    mesh.positions = {{-0.3f, 0, -0.2f}, {0.3f, 0, -0.2f}, {0.1f, 0, 0.3f}, {0, 0.5f, 0}};
    mesh.uvs = {{0, 0}, {1, 0}, {0.7f, 0.6f}, {0.4f, 1}};
    mesh.indices = {0, 1, 2, 1, 0, 3, 2, 1, 3, 0, 2, 3};
    floor.normal_map = normals;
    mesh.attributes.material = b.add(floor);
    mesh.attributes.source = "test object";
    object.meshes.push_back(std::move(mesh));
    d.objects.push_back(std::move(object));
    d.instances.push_back({0, translation(-0.5, 0.2, 0.5), "first"});
    d.instances.push_back({0, translation(0.3, 1.0, 0.4) * scaling(-0.8f, 1.5f, 0.6f), "mirrored"});
    return b.build();
}

}  // namespace lightloom::testing
