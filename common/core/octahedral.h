#pragma once
// The equal-area octahedral map between the unit square and the sphere [Clarberg 2008, Fast Equal-Area Mapping of the
// (Hemi)Sphere using SIMD], the layout of pbrt-v4's environment maps: the square's centre is +z, its corners are -z,
// u grows towards +x and v towards +y. Every part of the square has 4 pi times its area in solid angle.

#include <cmath>

#include "common/core/math.h"
#include "common/core/vec.h"

namespace lightloom {

/// Unit direction of a point of [0, 1]^2.
inline Vec3 octahedral_direction(double u, double v) {
    const double x = 2 * u - 1, y = 2 * v - 1;
    const double ax = std::fabs(x), ay = std::fabs(y);
    const double signed_distance = 1 - (ax + ay), d = std::fabs(signed_distance);
    const double r = 1 - d;
    const double phi = (r == 0 ? 1 : (ay - ax) / r + 1) * (kPiD / 4);
    const math::SinCos a = math::sincos(phi);
    const double z = std::copysign(1 - r * r, signed_distance);
    const double s = r * std::sqrt(2 - r * r);
    return {float(std::copysign(a.cos, x) * s), float(std::copysign(a.sin, y) * s), float(z)};
}

/// The inverse of octahedral_direction() for a unit direction.
inline Vec2 octahedral_square(const Vec3& w) {
    const double ax = std::fabs(double(w.x)), ay = std::fabs(double(w.y)), az = std::fabs(double(w.z));
    const double r = std::sqrt(az < 1 ? 1 - az : 0);
    const double phi = (ax == 0 && ay == 0) ? 0 : math::atan2(ay, ax) * (2 / kPiD);
    double v = phi * r, u = r - v;
    if (w.z < 0) {
        const double swapped = u;
        u = 1 - v;
        v = 1 - swapped;
    }
    u = std::copysign(u, double(w.x));
    v = std::copysign(v, double(w.y));
    return {float(0.5 * (u + 1)), float(0.5 * (v + 1))};
}

}  // namespace lightloom
