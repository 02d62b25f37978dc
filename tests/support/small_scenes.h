#pragma once
// Small scenes built in code, for tests that must not depend on the importer.

#include <memory>

#include "common/scene/scene.h"

namespace lightloom::testing {

/// Builds a SceneDescription piece by piece.
class SceneBuilder {
  public:
    SceneBuilder() {
        description_.film.width = description_.film.height = 32;
        description_.max_depth = 5;
    }
    SceneDescription& description() { return description_; }

    TextureId constant(const Rgb& value) {
        TextureNode node;
        node.value = value;
        description_.textures.push_back(node);
        return TextureId(description_.textures.size()) - 1;
    }
    MaterialId add(Material m) {
        description_.materials.push_back(std::move(m));
        return MaterialId(description_.materials.size()) - 1;
    }
    MaterialId diffuse(const Rgb& reflectance) {
        Material m;
        m.reflectance = constant(reflectance);
        return add(m);
    }
    int32_t emission(const Rgb& radiance, bool two_sided = false) {
        description_.emissions.push_back({radiance, two_sided});
        return int32_t(description_.emissions.size()) - 1;
    }
    /// Parallelogram with corners p, p+a, p+a+b, p+b; normal along a x b.
    TriangleMesh& quad(const Vec3& p, const Vec3& a, const Vec3& b, MaterialId material, int32_t emission = kNone) {
        TriangleMesh mesh;
        mesh.positions = {p, p + a, p + a + b, p + b};
        mesh.indices = {0, 1, 2, 0, 2, 3};
        mesh.attributes.material = material;
        mesh.attributes.emission = emission;
        mesh.attributes.source = "test quad";
        description_.meshes.push_back(std::move(mesh));
        return description_.meshes.back();
    }
    /// Six inward-facing walls of the box [lo, hi].
    void room(const Vec3& lo, const Vec3& hi, MaterialId material, int32_t emission = kNone) {
        const Vec3 d = hi - lo;
        const Vec3 x{d.x, 0, 0}, y{0, d.y, 0}, z{0, 0, d.z};
        quad(lo, z, x, material, emission);      // floor, +y
        quad(lo + y, x, z, material, emission);  // ceiling, -y
        quad(lo, y, z, material, emission);      // -x wall, +x
        quad(lo + x, z, y, material, emission);  // +x wall, -x
        quad(lo, x, y, material, emission);      // -z wall, +z
        quad(lo + z, y, x, material, emission);  // +z wall, -z
    }
    Sphere& sphere(const Vec3& centre, float radius, MaterialId material, int32_t emission = kNone) {
        Sphere s;
        s.centre = centre;
        s.radius = radius;
        s.attributes.material = material;
        s.attributes.emission = emission;
        s.attributes.source = "test sphere";
        description_.spheres.push_back(std::move(s));
        return description_.spheres.back();
    }
    /// Makes the last quad, or the last sphere, a surface that emits but that no ray meets.
    TriangleMesh& hide_quad() { return move_last(description_.meshes, description_.hidden_meshes); }
    Sphere& hide_sphere() { return move_last(description_.spheres, description_.hidden_spheres); }
    void look(const Vec3& eye, const Vec3& target, float fov) {
        description_.camera.camera_to_world = *inverse(*look_at(eye, target, {0, 1, 0}));
        description_.camera.fov_degrees = fov;
    }
    std::shared_ptr<const Scene> build(const SceneOptions& options = {}) {
        Result<std::unique_ptr<Scene>> scene = Scene::build(std::move(description_), options);
        if (!scene.ok()) throw std::runtime_error(scene.status().message());
        return std::shared_ptr<const Scene>(std::move(scene).value());
    }

  private:
    template <class Shape>
    static Shape& move_last(std::vector<Shape>& from, std::vector<Shape>& to) {
        to.push_back(std::move(from.back()));
        from.pop_back();
        return to.back();
    }

    SceneDescription description_;
};

/// Closed diffuse Cornell-like box with a ceiling lamp and a block, camera inside.
inline SceneBuilder cornell_builder(int size = 32) {
    SceneBuilder b;
    b.description().film.width = b.description().film.height = size;
    const MaterialId white = b.diffuse({0.7f, 0.7f, 0.7f}), red = b.diffuse({0.6f, 0.1f, 0.1f}),
                     green = b.diffuse({0.1f, 0.5f, 0.2f});
    b.room({-1, 0, -1}, {1, 2, 1}, white);
    b.description().meshes[2].attributes.material = red;
    b.description().meshes[3].attributes.material = green;
    b.quad({-0.3f, 1.99f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, white, b.emission({15, 12, 8}));
    b.sphere({0.4f, 0.4f, 0.3f}, 0.4f, white);
    b.quad({-0.7f, 0.6f, 0.1f}, {0, 0, 0.5f}, {0.5f, 0, 0}, white);
    b.look({0, 1, -0.95f}, {0, 0.9f, 1}, 80);
    return b;
}

}  // namespace lightloom::testing
