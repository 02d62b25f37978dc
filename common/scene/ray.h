#pragma once
// Rays, hits and the one rule for leaving a surface without hitting it again.

#include <bit>
#include <cmath>
#include <cstdint>

#include "common/core/inline.h"
#include "common/core/vec.h"

namespace lightloom {

/// A hit as the acceleration structure reports it.
struct RawHit {
    float t = 0;             ///< Distance, in units of the ray's direction length.
    uint32_t geometry = 0;   ///< Index of the mesh in its object or the world; the number of meshes stands for spheres.
    uint32_t primitive = 0;  ///< Triangle or sphere index.
    int32_t instance = -1;   ///< Index of the instance, or -1.
    float u = 0, v = 0;      ///< Barycentric weights of the second and third vertex.
};

/// `p` moved off its surface to the side that `direction` points to, by a distance that is a few hundred units in the
/// last place of each coordinate (with a floor near the origin) [Waechter and Binder 2019, A Fast and Robust Method for
/// Avoiding Self-Intersection], and never less than what `reach` asks for. `reach` bounds the coordinates of the whole
/// triangle or sphere that `p` lies on: the position of `p`, and where a ray finds the surface, are known to some units
/// in the last place of these coordinates, which near the origin of a large ground plane is far more than those of `p`.
/// The floor near the origin shrinks with `reach` below 1/4, for scenes that are small as a whole. Camera and light
/// sub-paths, next event and connections all use this one rule, so that a segment has the same visibility from either
/// end.
LL_ALWAYS_INLINE inline Vec3 offset_origin(const Vec3& p, const Vec3& geometric_normal, const Vec3& direction, float reach) {
    constexpr float kOrigin = 1.0f / 32, kIntScale = 256, kReachScale = 0x1p-20f;
    const Vec3 n = face_forward(geometric_normal, direction);
    const float least = kReachScale * reach, floor = reach < 0.25f ? 0x1p-14f * reach : 0x1p-16f;
    const auto move = [least, floor](float c, float nc) {
        float moved = c + floor * nc;
        if (!(std::fabs(c) < kOrigin)) {
            const int32_t steps = int32_t(kIntScale * nc);
            moved = std::bit_cast<float>(std::bit_cast<int32_t>(c) + (c < 0 ? -steps : steps));
        }
        const float asked = c + least * nc;
        return nc > 0 ? (moved > asked ? moved : asked) : (moved < asked ? moved : asked);
    };
    return {move(p.x, n.x), move(p.y, n.y), move(p.z, n.z)};
}

}  // namespace lightloom
