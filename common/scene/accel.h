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

/// Texture coordinates of a sphere, as pbrt's, at the outward unit normal `n`; `orientation` is Sphere::orientation.
Vec2 sphere_uv(const Frame& orientation, const Vec3& n);
inline Vec2 sphere_uv(const Sphere& sphere, const Vec3& n) { return sphere_uv(sphere.orientation, n); }

class Accel {
  public:
    /// Geometry index that the opacity callback gets for spheres.
    static constexpr uint32_t kSphereGeometry = 0xfffffff0u;

    /// A hit on a cut-out surface whose opacity is needed.
    struct OpacityQuery {
        int32_t object = -1;     ///< Index of the object definition, -1 in the world.
        int32_t instance = -1;   ///< Index of the instance, -1 in the world.
        uint32_t geometry = 0;   ///< Index of the mesh in its object or the world, or kSphereGeometry.
        uint32_t primitive = 0;  ///< Triangle or sphere index.
        float u = 0, v = 0;      ///< Barycentric as in RawHit, or the texture coordinates of a sphere.
        Vec3 outward;            ///< For a sphere: unit normal at the hit, in the object's space.
    };
    /// Opacity in [0, 1] of the cut-out surface at a hit. Called from inside the traversal for shapes with an alpha only.
    using Opacity = float (*)(const void* user, const OpacityQuery& query);

    ~Accel();
    /// Keeps references to the description, which must outlive it; mesh positions must carry one vertex of padding.
    static Result<std::unique_ptr<Accel>> build(const SceneDescription& scene, Opacity opacity, const void* opacity_user);

    /// Closest hit with t_min < t < t_max along o + t d.
    bool intersect(const Vec3& o, const Vec3& d, float t_min, float t_max, RawHit* hit) const;
    /// The same, but among the meshes of keep_apart() only.
    bool intersect_apart(const Vec3& o, const Vec3& d, float t_min, float t_max, RawHit* hit) const;
    /// Builds an additional structure of these world meshes alone.
    Status keep_apart(const SceneDescription& scene, const std::vector<uint32_t>& meshes, Opacity opacity,
                      const void* opacity_user);
    /// Calls `visit` for every primitive that may be closer to `centre` than `radius` (RawHit::t, u and v are not set), as
    /// long as it returns true. This is for building only: it is slow and may visit a primitive several times.
    void for_each_near(const Vec3& centre, float radius, const std::function<bool(const RawHit&)>& visit) const;
    /// Whether anything lies at 0 < t < t_max. Cut-out surfaces let a ray through with probability 1 - opacity, decided
    /// by a hash of the ray, so that the answer is reproducible.
    bool occluded(const Vec3& o, const Vec3& d, float t_max) const;

    Bounds3 bounds() const;
    uint64_t memory_bytes() const;

  private:
    Accel();
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace lightloom
