#include "common/scene/scene.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/core/math.h"
#include "common/core/rng.h"
#include "common/scene/bump.h"

namespace lightloom {
namespace {

/// Uniform in [0, 1) from the bits of a position: it decides about mixed materials. The decision depends on the point
/// alone and not on the technique that found it.
float position_hash(const Vec3& p) {
    const uint64_t xy = (uint64_t(std::bit_cast<uint32_t>(p.x)) << 32) | std::bit_cast<uint32_t>(p.y);
    return float(mix64(mix64(xy + 0x632be59bd9b4e019ull) ^ std::bit_cast<uint32_t>(p.z)) >> 40) * 0x1p-24f;
}

}  // namespace

void Scene::triangle_point(const TriangleMesh& mesh, const RawHit& hit, SurfacePoint* out) const {
    const uint32_t* index = &mesh.indices[size_t(hit.primitive) * 3];
    const Vec3 &p0 = mesh.positions[index[0]], &p1 = mesh.positions[index[1]], &p2 = mesh.positions[index[2]];
    const Vec3 e1 = p1 - p0, e2 = p2 - p0;
    const float b1 = hit.u, b2 = hit.v, b0 = 1 - b1 - b2;
    out->p = p0 + e1 * b1 + e2 * b2;
    out->reach = std::max({largest_coordinate(p0), largest_coordinate(p1), largest_coordinate(p2)});
    out->ng = normalize(cross(e1, e2));
    if (mesh.attributes.flip_normal) out->ng = -out->ng;
    Vec2 uv[3] = {{0, 0}, {1, 0}, {1, 1}};
    if (!mesh.uvs.empty())
        for (int i = 0; i < 3; ++i) uv[i] = mesh.uvs[index[i]];
    out->uv = {b0 * uv[0].x + b1 * uv[1].x + b2 * uv[2].x, b0 * uv[0].y + b1 * uv[1].y + b2 * uv[2].y};
    Vec3 n = out->ng;
    if (!mesh.normals.empty()) {
        const Vec3 ns = mesh.normals[index[0]] * b0 + mesh.normals[index[1]] * b1 + mesh.normals[index[2]] * b2;
        const float len2 = length_squared(ns);
        if (len2 > 0) {
            n = ns / std::sqrt(len2);
            out->ng = face_forward(out->ng, n);
        }
    }
    const float du1 = uv[1].x - uv[0].x, dv1 = uv[1].y - uv[0].y, du2 = uv[2].x - uv[0].x, dv2 = uv[2].y - uv[0].y;
    out->shading = frame_along(n, (e1 * dv2 - e2 * dv1) * (du1 * dv2 - dv1 * du2 < 0 ? -1.0f : 1.0f));
    out->material = mesh.attributes.material;
}

/// Finds the hit that counts: where an area light lies in the plane of the surface that was hit, the light wins.
bool Scene::find_surface(const Vec3& o, const Vec3& d, float clearance, RawHit* hit) const {
    if (!accel_->intersect(o, d, clearance, 1e30f, hit)) return false;
    if (!covered_.any) [[likely]]
        return true;
    const float gap = hit->instance >= 0                       ? covered_.instances[size_t(hit->instance)]
                      : hit->geometry < covered_.meshes.size() ? covered_.meshes[hit->geometry]
                                                               : 0;
    if (!(gap > 0)) return true;
    // Two planes that differ by rounding are farther apart along a grazing ray.
    SurfacePoint point;
    surface_point(o, d, *hit, &point);
    constexpr float kGrazing = 1e-3f;
    const float apart = gap / std::max(abs_dot(point.ng, d), kGrazing);
    RawHit light;
    if (accel_->intersect_apart(o, d, std::max(clearance, hit->t - apart), hit->t + apart, &light)) *hit = light;
    return true;
}

bool Scene::intersect(const Vec3& o, const Vec3& d, SurfacePoint* out, float clearance) const {
    RawHit hit;
    if (!find_surface(o, d, clearance, &hit)) return false;
    surface_point(o, d, hit, out);
    if (!tilts_.empty() && tilts_[size_t(out->material)] != 0) tilt(hit, out);
    return true;
}

void Scene::surface_point(const Vec3& o, const Vec3& d, const RawHit& hit, SurfacePoint* out) const {
    const bool instanced = hit.instance >= 0;
    const ObjectDefinition* object =
        instanced ? &description_->objects[size_t(description_->instances[size_t(hit.instance)].object)] : nullptr;
    const auto& meshes = instanced ? object->meshes : description_->meshes;
    if (hit.geometry < meshes.size()) {
        triangle_point(meshes[hit.geometry], hit, out);
        const int32_t first = instanced ? kNone : mesh_first_emitter_[hit.geometry];
        out->emitter = first == kNone ? kNone : first + int32_t(hit.primitive);
        // The emitting side is that of the whole triangle, as for light sampling, even where interpolated normals cross
        // its plane.
        if (out->emitter != kNone) {
            const Emitter& e = emitters_[uint32_t(out->emitter)];
            out->ng = face_forward(out->ng, e.normal);
            out->reach = e.reach;
        }
    } else {
        const Sphere& s = (instanced ? object->spheres : description_->spheres)[hit.primitive];
        Vec3 from = o, along = d;
        if (instanced) {
            const Mat4& inv = instance_inverse_[size_t(hit.instance)];
            from = inv.point(o), along = inv.vector(d);
        }
        const Vec3 n = normalize(from + along * hit.t - s.centre);
        out->p = s.centre + n * s.radius;
        out->reach = largest_coordinate(s.centre) + s.radius;
        out->ng = s.attributes.flip_normal ? -n : n;
        const Vec3 local = s.orientation.to_local(n);
        out->uv = sphere_uv(s, n);
        out->shading = frame_along(out->ng, s.orientation.to_world({-local.y, local.x, 0}));
        out->material = s.attributes.material;
        out->emitter = instanced ? kNone : sphere_emitter_[hit.primitive];
    }
    if (instanced) {
        const Mat4& m = description_->instances[size_t(hit.instance)].object_to_world;
        const Mat4& inv = instance_inverse_[size_t(hit.instance)];
        out->p = m.point(out->p);
        float reach = 0;
        for (const auto& row : m.m)
            reach = std::max(reach,
                             float((std::fabs(row[0]) + std::fabs(row[1]) + std::fabs(row[2])) * out->reach + std::fabs(row[3])));
        out->reach = reach;
        out->ng = normalize(inv.normal_by_inverse(out->ng));
        const Vec3 n = normalize(inv.normal_by_inverse(out->shading.n));
        out->shading = frame_along(n, m.vector(out->shading.s));
    }
    out->reach = std::max(out->reach, least_reach_);
}

void Scene::tilt(const RawHit& hit, SurfacePoint* point) const {
    point->material = choose_material(tables_, point->material, {point->uv, point->p}, position_hash(point->p));
    if (point->material == kNone) return;
    const Material& material = description_->materials[size_t(point->material)];
    if (material.displacement == kNone && material.normal_map == kNone) return;
    const Instance* instance = hit.instance >= 0 ? &description_->instances[size_t(hit.instance)] : nullptr;
    const Mat4* to_object = instance ? &instance_inverse_[size_t(hit.instance)] : nullptr;
    const ObjectDefinition* object = instance ? &description_->objects[size_t(instance->object)] : nullptr;
    const auto& meshes = object ? object->meshes : description_->meshes;
    SurfaceTangents tangents;
    if (hit.geometry < meshes.size()) {
        tangents = tangents_of(meshes[hit.geometry], hit);
    } else {
        const Sphere& s = (object ? object->spheres : description_->spheres)[hit.primitive];
        tangents = tangents_of(s, normalize((to_object ? to_object->point(point->p) : point->p) - s.centre));
    }
    if (instance) tangents.transform(instance->object_to_world, *to_object);
    point->shading = tilted_frame(tables_, material, *point, tangents);
}

Bsdf Scene::bsdf_at(const SurfacePoint& point) const {
    return resolve_material(tables_, point.material, {point.uv, point.p}, position_hash(point.p));
}

bool Scene::occluded(const Vec3& p, const Vec3& ng_p, float reach_p, const Vec3& q, const Vec3& ng_q, float reach_q) const {
    const Vec3 d = q - p;
    const Vec3 from = offset_origin(p, ng_p, d, reach_p), to = offset_origin(q, ng_q, -d, reach_q);
    return accel_->occluded(from, to - from, 0.99999f);
}

bool Scene::occluded(const Vec3& p, const Vec3& ng_p, float reach_p, const Vec3& q, float clearance) const {
    const Vec3 from = offset_origin(p, ng_p, q - p, reach_p);
    const Vec3 d = q - from;
    const float t_max = clearance > 0 ? 1 - clearance / length(d) : 1;
    return !(t_max > 0) || accel_->occluded(from, d, t_max);
}

float Scene::opacity(const void* user, const Accel::OpacityQuery& query) {
    const Scene& scene = *static_cast<const Scene*>(user);
    const SceneDescription& d = *scene.description_;
    const bool needs_place = !d.texture_spaces.empty();
    TexturePoint at{{query.u, query.v}, {}};
    TextureId alpha;
    if (query.geometry == Accel::kSphereGeometry) {
        const Sphere& s = (query.object < 0 ? d.spheres : d.objects[size_t(query.object)].spheres)[query.primitive];
        alpha = s.attributes.alpha;
        if (alpha == kNone) return 1;
        if (needs_place) at.p = s.centre + query.outward * s.radius;
    } else {
        const TriangleMesh& mesh = (query.object < 0 ? d.meshes : d.objects[size_t(query.object)].meshes)[query.geometry];
        alpha = mesh.attributes.alpha;
        const uint32_t* index = &mesh.indices[size_t(query.primitive) * 3];
        Vec2 uv[3] = {{0, 0}, {1, 0}, {1, 1}};
        if (!mesh.uvs.empty())
            for (int i = 0; i < 3; ++i) uv[i] = mesh.uvs[index[i]];
        const float u = query.u, v = query.v, w = 1 - u - v;
        at.uv = {w * uv[0].x + u * uv[1].x + v * uv[2].x, w * uv[0].y + u * uv[1].y + v * uv[2].y};
        const Vec3& p0 = mesh.positions[index[0]];
        if (needs_place) at.p = p0 + (mesh.positions[index[1]] - p0) * u + (mesh.positions[index[2]] - p0) * v;
    }
    if (needs_place && query.instance >= 0) at.p = d.instances[size_t(query.instance)].object_to_world.point(at.p);
    return evaluate_texture(scene.tables_, alpha, at).r;
}

}  // namespace lightloom
