#pragma once
// A unit vector in 32 bits: the octahedral projection [Meyer et al. 2010, On Floating-Point Normal Vectors], 16 bits per
// coordinate. The direction is off by less than 7e-5 radians.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/core/vec.h"

namespace lightloom {

class PackedNormal {
  public:
    constexpr PackedNormal() = default;
    /// The vector need not be normalised. One without a direction (zero, not finite) becomes the +z axis.
    PackedNormal(const Vec3& v) {  // NOLINT(google-explicit-constructor): stands in for a Vec3
        const float sum = std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z);
        if (!(sum > 0) || !std::isfinite(sum)) return;
        float x = v.x / sum, y = v.y / sum;
        if (v.z < 0) fold(x, y);
        bits_ = uint32_t(quantised(x)) | uint32_t(quantised(y)) << 16;
    }
    operator Vec3() const {  // NOLINT(google-explicit-constructor)
        float x = coordinate(uint16_t(bits_)), y = coordinate(uint16_t(bits_ >> 16));
        const float z = 1 - std::fabs(x) - std::fabs(y);
        if (z < 0) fold(x, y);
        return normalize(Vec3{x, y, z});
    }
    friend constexpr bool operator==(PackedNormal, PackedNormal) = default;

  private:
    static constexpr float kScale = 32767;

    /// Swaps the lower half of the octahedron with the corners of the square.
    static void fold(float& x, float& y) {
        const float u = (1 - std::fabs(y)) * (x < 0 ? -1.0f : 1.0f);
        y = (1 - std::fabs(x)) * (y < 0 ? -1.0f : 1.0f);
        x = u;
    }
    static uint16_t quantised(float c) { return uint16_t(int16_t(std::lround(std::clamp(c, -1.0f, 1.0f) * kScale))); }
    static float coordinate(uint16_t bits) { return std::max(-1.0f, float(int16_t(bits)) / kScale); }

    uint32_t bits_ = 0;
};

}  // namespace lightloom
