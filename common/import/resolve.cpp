// The last pass: materials, textures and area lights of every shape, in file order.

#include <cmath>
#include <map>
#include <tuple>

#include "common/core/math.h"
#include "common/import/context.h"

namespace lightloom::import {
namespace {

double triangle_area(const TriangleMesh& mesh, size_t first) {
    const auto edge = [&](size_t i) {
        const Vec3 &a = mesh.positions[mesh.indices[first]], &b = mesh.positions[mesh.indices[first + i]];
        return std::array<double, 3>{double(b.x) - a.x, double(b.y) - a.y, double(b.z) - a.z};
    };
    const auto u = edge(1), v = edge(2);
    const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return 0.5 * std::sqrt(x * x + y * y + z * z);
}

/// Index of an equal emission, or of a new one.
int32_t add_emission(Context* context, const AreaEmission& emission) {
    const auto key =
        std::make_tuple(emission.radiance.r, emission.radiance.g, emission.radiance.b, emission.two_sided, emission.image);
    const auto [it, inserted] = context->emission_index.try_emplace(key, int32_t(context->scene.emissions.size()));
    if (inserted) context->scene.emissions.push_back(emission);
    return it->second;
}

/// The part of `mesh` with the triangles listed.
TriangleMesh subset(const TriangleMesh& mesh, const std::vector<size_t>& triangles) {
    TriangleMesh out;
    out.attributes = mesh.attributes;
    std::map<uint32_t, uint32_t> renumbered;
    for (const size_t first : triangles)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t old = mesh.indices[first + k];
            const auto [it, inserted] = renumbered.try_emplace(old, uint32_t(out.positions.size()));
            if (inserted) {
                out.positions.push_back(mesh.positions[old]);
                if (!mesh.normals.empty()) out.normals.push_back(mesh.normals[old]);
                if (!mesh.uvs.empty()) out.uvs.push_back(mesh.uvs[old]);
            }
            out.indices.push_back(it->second);
        }
    return out;
}

/// As in pbrt, every triangle, disk, sphere and patch (also a PLY quadrilateral) is a light of its own with the given
/// power, which its triangles share by area; lights of equal radiance stay together.
void add_powered_mesh(Context* context, TriangleMesh&& mesh, const PendingShape& shape, bool hidden) {
    const size_t triangles_in_all = mesh.indices.size() / 3;
    const auto face_of = [&](size_t triangle) { return shape.faces.empty() ? triangle : shape.faces[triangle]; };
    const size_t count = triangles_in_all == 0 ? 0 : face_of(triangles_in_all - 1) + 1;
    std::vector<double> areas(count);
    for (size_t i = 0; i < triangles_in_all; ++i) areas[face_of(i)] += triangle_area(mesh, 3 * i);
    std::map<float, std::vector<size_t>> by_area;
    for (size_t i = 0; i < triangles_in_all; ++i)
        if (triangle_area(mesh, 3 * i) > 0) by_area[float(areas[face_of(i)])].push_back(3 * i);
    if (count > 1)
        context->diagnostics.warn(shape.where, "as in pbrt, each of the " + std::to_string(count) +
                                                   (shape.faces.empty() ? " triangles" : " faces") +
                                                   " of this light emits the given power");
    std::vector<TriangleMesh>& meshes = hidden ? context->scene.hidden_meshes : context->scene.meshes;
    const auto add_part = [&](TriangleMesh part, float area) {
        part.attributes.emission = add_emission(context, area_emission(context, *shape.area_light, double(area)));
        meshes.push_back(std::move(part));
    };
    for (const auto& [area, triangles] : by_area) {
        if (triangles.size() == triangles_in_all) return add_part(std::move(mesh), area);  // the whole mesh
        add_part(subset(mesh, triangles), area);
    }
}

bool is_zero(const TextureNode& alpha) { return alpha.kind == TextureKind::kConstant && alpha.value == Rgb(0.0f); }

void add_shape(Context* context, PendingShape shape) {
    SceneDescription& scene = context->scene;
    ObjectDefinition* object = shape.object == kNone ? nullptr : &scene.objects[size_t(shape.object)];
    TriangleMesh* mesh = std::get_if<TriangleMesh>(&shape.geometry);
    Sphere* sphere = std::get_if<Sphere>(&shape.geometry);
    ShapeAttributes& attributes = mesh ? mesh->attributes : sphere->attributes;
    attributes.source = shape.where.text();
    attributes.material = resolve_material_reference(context, shape.material);
    if (attributes.material == kInterfaceMaterial) {
        if (shape.area_light)
            context->diagnostics.warn(shape.where,
                                      "an area light on a shape with the \"interface\" material is ignored, as in pbrt");
        return;
    }
    if (!shape.alpha_texture.empty())
        attributes.alpha = named_texture(context, shape.where, shape.alpha_texture, TextureUse::kFloat);
    else if (shape.alpha != 1)
        attributes.alpha = constant_texture(context, Rgb(shape.alpha));
    bool hidden = false;
    if (shape.area_light) {
        // As in pbrt-v4, where alpha is 0 everywhere, no ray meets the shape, but all of it emits.
        hidden = attributes.alpha != kNone && is_zero(scene.textures[size_t(attributes.alpha)]);
        if (hidden) attributes.alpha = kNone;
        if (attributes.alpha != kNone)
            fail(shape.where,
                 "an emitting shape with an alpha other than 0 and 1 is not supported: the light sampled on it would be that of "
                 "the uncut shape; cut the geometry instead");
        const bool powered = area_light_uses_power(*shape.area_light);
        if (powered && shape.is_scaled_quadric)
            context->diagnostics.warn(shape.where,
                                      "the light emits its power from the sphere, disk or cylinder as it is scaled; pbrt-v4 "
                                      "takes the area before the transformation, and warns of the scale");
        if (powered && mesh) return add_powered_mesh(context, std::move(*mesh), shape, hidden);
        const double area = sphere ? 4 * kPiD * double(sphere->radius) * sphere->radius : 0;
        const AreaEmission emission = area_emission(context, *shape.area_light, area);
        if (!emission.radiance.is_black()) attributes.emission = add_emission(context, emission);
        if (hidden && attributes.emission == kNone) return;  // It is neither visible nor does it emit.
    }
    if (mesh)
        (object ? object->meshes : hidden ? scene.hidden_meshes : scene.meshes).push_back(std::move(*mesh));
    else
        (object ? object->spheres : hidden ? scene.hidden_spheres : scene.spheres).push_back(*sphere);
}

}  // namespace

void resolve_shapes(Context* context) {
    Diagnostics& d = context->diagnostics;
    for (PendingShape& shape : context->shapes) d.guard([&] { add_shape(context, std::move(shape)); });
    context->shapes.clear();
    // Definitions that no shape uses are still checked: a typing error in them should not wait for their first use.
    const auto for_each_definition = [&](const std::map<std::string, Definition>& definitions, const auto& check) {
        for (const auto& entry : definitions) d.guard([&] { check(entry.first, entry.second.parameters.where()); });
    };
    for_each_definition(context->named_materials, [&](const std::string& name, const Location& where) {
        resolve_material_reference(context, {true, name, 0, where});
    });
    for (size_t i = 1; i < context->anonymous_materials.size(); ++i)
        d.guard([&] {
            resolve_material_reference(context, {false, "", int(i), context->anonymous_materials[i].parameters.where()});
        });
    for_each_definition(context->float_textures, [&](const std::string& name, const Location& where) {
        named_texture(context, where, name, TextureUse::kFloat);
    });
    for_each_definition(context->spectrum_textures, [&](const std::string& name, const Location& where) {
        const bool used = context->resolved_textures.contains({name, TextureUse::kUnbounded});
        if (!used) named_texture(context, where, name, TextureUse::kReflectance);
    });
}

}  // namespace lightloom::import
