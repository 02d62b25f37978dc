#pragma once
// Surfaces at distance zero of a camera, a lamp or an area light: what lies there is decided once, when the scene is built, by
// positions alone, so that a ray sees the same from either of its ends.
//
//   A lens or lamp that touches a surface   is on neither side of it: within its clearance nothing is hit, hides it or
//                                           is lit by it.
//   An area light in another surface's      takes the other surface's place: rays that hit the other surface within
//   plane                                   rounding of the light hit the light instead, and the light's own rays start
//                                           clear of both.
//
// "Zero" is what single precision cannot tell from zero: a few units in the last place of the coordinates that decide where the
// plane is. A ground at y = 0 is known exactly, however wide it is; a tilted one to some units of its extent.

#include <cstdint>
#include <functional>
#include <vector>

#include "common/scene/accel.h"
#include "common/scene/emitter.h"

namespace lightloom {

/// In scenes whose coordinates are all smaller than this, offsets shrink with the coordinates.
inline constexpr float kSmallScene = 0.25f;

class ContactFinder {
  public:
    /// Scene and structure must outlive this object. `instance_inverse` has one matrix per instance.
    ContactFinder(const SceneDescription& scene, const Accel& accel, const std::vector<Mat4>& instance_inverse, float largest);

    /// Distance from a lens or lamp at `p` within which surfaces do not exist for its rays: 0 where none touches it.
    float clearance(const Vec3& p) const;
    /// The same for rays that start anywhere in the parallelogram of `corner` and two edges: 0 where no triangle shares
    /// a part of it.
    float clearance(const Vec3& corner, const Vec3& edge1, const Vec3& edge2) const;

    /// Shapes that lie in the plane of an emitter and overlap it.
    struct Covered {
        std::vector<float> meshes, instances;  ///< By index: distance that the planes may have; 0 without contact.
        bool any = false;
    };
    /// Finds the covered shapes. `emits(mesh)` tells whether a world mesh emits; such meshes are never covered. Raises
    /// the reach of every emitter in contact to that of the surface it touches.
    Covered cover(std::vector<Emitter>* emitters, const std::function<bool(uint32_t mesh)>& emits) const;

  private:
    /// Calls `visit` for every primitive that may touch the triangle, for some perhaps several times. The triangle is
    /// divided where many primitives lie near it, so that primitives that are only in the ball around a large triangle,
    /// like a forest under a panel, are left out.
    void for_each_near(const Vec3 (&corners)[3], int level, const std::function<void(const RawHit&)>& visit) const;

    const SceneDescription& scene_;
    const Accel& accel_;
    const std::vector<Mat4>& instance_inverse_;
    float largest_;  ///< Largest coordinate magnitude of the scene.
};

}  // namespace lightloom
