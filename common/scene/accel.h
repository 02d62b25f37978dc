#pragma once
// The acceleration structure. accel.cpp is the only file of the project that includes Embree.
//
// Byte identity: Embree's instruction set is pinned (its kernels round differently from set to set), and the structure is
// built on one thread, because a parallel build may order equal-distance primitives differently and so change which of two
// coplanar triangles a ray reports.

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"
#include "common/scene/ray.h"

namespace lightloom {

/// Texture coordinates of a sphere, pbrt's, at the outward unit normal `n`; `orientation` as Sphere's.
Vec2 sphere_uv(const Frame& orientation, const Vec3& n);
inline Vec2 sphere_uv(const Sphere& sphere, const Vec3& n) { return sphere_uv(sphere.orientation, n); }

class Accel {
  public:
    /// Geometry index that the opacity callback gets for spheres.
    static constexpr uint32_t kSphereGeometry = 0xfffffff0u;

    /// Opacity in [0, 1] of the cut-out surface at a hit: (object definition, -1 in the world; geometry, primitive, u, v). Called
    /// from inside the traversal for shapes with an alpha only.
    using Opacity = float (*)(const void* user, int32_t object, uint32_t geometry, uint32_t primitive, float u, float v);

    ~Accel();
    /// Keeps references to the description, which must outlive it; mesh positions must carry one vertex of padding.
    static Result<std::unique_ptr<Accel>> build(const SceneDescription& scene, Opacity opacity, const void* opacity_user);

    /// Closest hit with 0 < t < t_max along o + t d.
    bool intersect(const Vec3& o, const Vec3& d, float t_max, RawHit* hit) const;
    /// Whether anything lies at 0 < t < t_max. Cut-out surfaces let a ray through with probability 1 - opacity, decided by
    /// a hash of the ray, so an opaque answer is reproducible.
    bool occluded(const Vec3& o, const Vec3& d, float t_max) const;

    Bounds3 bounds() const;
    uint64_t memory_bytes() const;

  private:
    Accel();
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace lightloom
