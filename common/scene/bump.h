#pragma once
// Displacement and normal maps: materials that tilt the shading frame and leave the surface where it is [Blinn 1978, Simulation
// of Wrinkled Surfaces]. The tilted normal is a shading normal like an interpolated one: everything that asks for the geometric
// one (emission, offsets of rays, the adjoint correction [Veach 1997, 5.3]) still gets that.
//
// As in pbrt-v4, a height h(u, v) along the shading normal n gives
//     dp/du' = dp/du + dh/du n + h dn/du,   dp/dv' likewise,   n' along dp/du' x dp/dv', on the side of the geometric normal,
// and dh/du is a quotient of differences. pbrt's step is the footprint of a camera's pixel where it is known, and
// 0.0005 otherwise. Here the step is always 0.0005, because the normal has to be the same for every technique that
// finds the point.
//
// A normal map holds a normal's coordinates along dp/du, n x dp/du and n.

#include <cmath>

#include "common/core/transform.h"
#include "common/core/vec.h"
#include "common/scene/ray.h"
#include "common/scene/texture.h"

namespace lightloom {

struct SurfacePoint;

/// A tangent frame around `n` aligned with dp/du where there is one (anisotropic roughness needs it).
inline Frame frame_along(const Vec3& n, const Vec3& dpdu) {
    const Vec3 t = cross(n, dpdu);
    const float len2 = length_squared(t);
    if (!(len2 > 0)) return Frame(n);
    const Vec3 unit_t = t / std::sqrt(len2);
    return {cross(unit_t, n), unit_t, n};
}

/// How a point of a surface and its shading normal change with the texture coordinates.
struct SurfaceTangents {
    Vec3 dpdu, dpdv;  ///< Perpendicular to the shading normal, scene units.
    Vec3 dndu, dndv;
    Vec3 n;                 ///< The shading normal, unit.
    bool mirrored = false;  ///< The transformation that placed the surface swaps handedness.

    /// Transforms the tangents by `m`; `inverse` is its inverse.
    void transform(const Mat4& m, const Mat4& inverse);
};

/// The tangents at a point of a triangle. As in pbrt-v4, a mesh with normals has dp/du turned by 90 degrees for its
/// dp/dv (so that v is stretched as u is); but a mesh that stands for a curved surface has that surface's tangents.
/// Where (u, v) is degenerate, the tangents are two perpendicular unit vectors. A mirrored mesh is the mirror image of
/// the unmirrored one.
SurfaceTangents tangents_of(const TriangleMesh& mesh, const RawHit& hit);
/// The tangents of a sphere at the outward unit normal `outward`.
SurfaceTangents tangents_of(const Sphere& sphere, const Vec3& outward);

/// The shading frame that `material`, with its displacement or normal map, gives to `point`, whose frame is the
/// unmodified one. Where the new frame is undefined (a normal of length zero in the map, heights beyond single
/// precision), the unmodified one is returned.
Frame tilted_frame(const TextureTables& tables, const Material& material, const SurfacePoint& point,
                   const SurfaceTangents& tangents);

}  // namespace lightloom
