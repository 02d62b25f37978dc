#include "common/scene/bump.h"

#include "common/core/math.h"
#include "common/scene/scene.h"

namespace lightloom {
namespace {

/// Step of u and v at which textures are looked up beside the point.
constexpr float kStep = 0.0005f;

Vec3 perpendicular(const Vec3& v, const Vec3& unit_n) { return v - unit_n * dot(v, unit_n); }

/// Makes `n` a unit vector; false if it has no direction.
bool normalise(Vec3* n) {
    const float len2 = length_squared(*n);
    if (!(len2 > 0) || !std::isfinite(len2)) return false;
    *n = *n / std::sqrt(len2);
    return true;
}

}  // namespace

void SurfaceTangents::transform(const Mat4& m, const Mat4& inverse) {
    const Vec3 normal = inverse.normal_by_inverse(n);
    const float scale = 1 / length(normal);
    dpdu = m.vector(dpdu);
    dpdv = m.vector(dpdv);
    dndu = inverse.normal_by_inverse(dndu) * scale;
    dndv = inverse.normal_by_inverse(dndv) * scale;
    n = normal * scale;
    mirrored = mirrored != m.swaps_handedness();
}

SurfaceTangents tangents_of(const TriangleMesh& mesh, const RawHit& hit) {
    const uint32_t* index = &mesh.indices[size_t(hit.primitive) * 3];
    const Vec3 e1 = mesh.positions[index[1]] - mesh.positions[index[0]], e2 = mesh.positions[index[2]] - mesh.positions[index[0]];
    Vec2 uv[3] = {{0, 0}, {1, 0}, {1, 1}};
    if (!mesh.uvs.empty())
        for (int i = 0; i < 3; ++i) uv[i] = mesh.uvs[index[i]];
    const float du1 = uv[1].x - uv[0].x, dv1 = uv[1].y - uv[0].y, du2 = uv[2].x - uv[0].x, dv2 = uv[2].y - uv[0].y;
    const float determinant = du1 * dv2 - dv1 * du2;
    constexpr float kDegenerate = 1e-9f;  // pbrt's bound
    const bool degenerate = !(std::fabs(determinant) >= kDegenerate);
    const auto by_u = [&](const Vec3& a, const Vec3& b) { return (a * dv2 - b * dv1) / determinant; };
    const auto by_v = [&](const Vec3& a, const Vec3& b) { return (b * du1 - a * du2) / determinant; };

    SurfaceTangents out;
    out.mirrored = mesh.attributes.mirrored;
    out.n = normalize(cross(e1, e2));
    if (mesh.attributes.flip_normal) out.n = -out.n;
    if (!mesh.normals.empty()) {
        const Vec3 &n0 = mesh.normals[index[0]], &n1 = mesh.normals[index[1]], &n2 = mesh.normals[index[2]];
        Vec3 n = n0 * (1 - hit.u - hit.v) + n1 * hit.u + n2 * hit.v;
        if (normalise(&n)) out.n = n;
        if (!degenerate) out.dndu = by_u(n1 - n0, n2 - n0), out.dndv = by_v(n1 - n0, n2 - n0);
    }
    if (!degenerate) {
        out.dpdu = perpendicular(by_u(e1, e2), out.n);
        if (mesh.normals.empty() || mesh.curved)
            out.dpdv = perpendicular(by_v(e1, e2), out.n);
        else
            out.dpdv = cross(out.n, out.dpdu) * (out.mirrored ? -1.0f : 1.0f);
    }
    if (degenerate || !(length_squared(cross(out.dpdu, out.dpdv)) > 0)) {
        const Frame any(out.n);
        out.dpdu = any.s, out.dpdv = any.t;
    }
    return out;
}

SurfaceTangents tangents_of(const Sphere& sphere, const Vec3& outward) {
    const Vec3 local = sphere.orientation.to_local(outward);
    const float sine = safe_sqrt(local.x * local.x + local.y * local.y);
    // At the poles, where dp/du vanishes, any azimuth will do.
    const float cos_phi = sine > 0 ? local.x / sine : 1, sin_phi = sine > 0 ? local.y / sine : 0;
    const float turn = kTwoPi * sphere.radius, half_turn = kPi * sphere.radius;  // u goes once around, v from pole to pole
    SurfaceTangents out;
    out.dpdu = sphere.orientation.to_world({-local.y * turn, local.x * turn, 0});
    out.dpdv = sphere.orientation.to_world({-local.z * cos_phi * half_turn, -local.z * sin_phi * half_turn, sine * half_turn});
    const float side = sphere.attributes.flip_normal ? -1.0f : 1.0f;
    out.n = outward * side;
    out.dndu = out.dpdu * (side / sphere.radius);
    out.dndv = out.dpdv * (side / sphere.radius);
    out.mirrored = sphere.attributes.mirrored;
    return out;
}

Frame tilted_frame(const TextureTables& tables, const Material& material, const SurfacePoint& point,
                   const SurfaceTangents& tangents) {
    const Frame& flat = point.shading;
    Vec3 n, dpdu = flat.s;
    if (material.normal_map != kNone) {
        const Rgb code = evaluate_texture(tables, material.normal_map, {point.uv, point.p});
        const Vec3 t = tangents.mirrored ? -flat.t : flat.t;
        n = flat.s * (2 * code.r - 1) + t * (2 * code.g - 1) + flat.n * (2 * code.b - 1);
    } else {
        // Where (u, v) is large the step is rounded, in the end to zero.
        const float du = (point.uv.x + kStep) - point.uv.x, dv = (point.uv.y + kStep) - point.uv.y;
        const auto height = [&](float u, float v) {
            return evaluate_texture(tables, material.displacement,
                                    {{point.uv.x + u, point.uv.y + v}, point.p + tangents.dpdu * u + tangents.dpdv * v})
                .r;
        };
        const float h = height(0, 0);
        const float slope_u = du > 0 ? (height(du, 0) - h) / du : 0, slope_v = dv > 0 ? (height(0, dv) - h) / dv : 0;
        dpdu = tangents.dpdu + flat.n * slope_u + tangents.dndu * h;
        Vec3 dpdv = tangents.dpdv + flat.n * slope_v + tangents.dndv * h;
        if (dpdu == tangents.dpdu && dpdv == tangents.dpdv) return flat;
        // The tangents are normalised first, because the squared product of small ones underflows in single precision.
        if (!normalise(&dpdu) || !normalise(&dpdv)) return flat;
        n = cross(dpdu, dpdv);
    }
    if (!normalise(&n)) return flat;
    // The normal stays on the side of the unmodified frame's; an emitter's interpolated normals may be turned away from
    // the geometric one.
    const Vec3 side = dot(flat.n, point.ng) < 0 ? -point.ng : point.ng;
    return frame_along(face_forward(n, side), dpdu);
}

}  // namespace lightloom
