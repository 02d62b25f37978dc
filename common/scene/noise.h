#pragma once
// Gradient noise, and the procedural textures made of it. Values are those of pbrt-v4 without its filtering: pbrt
// leaves out octaves that a pixel could not resolve, which here the samples of the pixel average.

#include "common/core/vec.h"

namespace lightloom {

/// Gradient noise [Perlin 2002, Improving Noise], with the permutation of its reference implementation and, as in
/// pbrt-v4, the gradients of its four spare hashes repeated in the plane of x and y or y and z. The noise is zero at
/// points with whole coordinates, at most kNoiseBound in magnitude everywhere, and has a period of 256 along every
/// axis. It is zero where a coordinate is not finite.
float noise(const Vec3& p);

/// Bound of |noise|: the weights of the eight corners times the largest products with any gradients give at most 1.0364.
inline constexpr float kNoiseBound = 1.04f;

/// Sum over `octaves` of omega^i noise(1.99^i p): fractional Brownian motion.
float fractal_noise(const Vec3& p, float omega, int octaves);

/// Sum over `octaves` of omega^i |noise(1.99^i p)|, plus 0.2 omega^octaves for the mean of the octaves left out, as in
/// pbrt-v4.
float turbulence(const Vec3& p, float omega, int octaves);

/// Whether (s, t) lies in a dot of pbrt-v4's "dots": about half of the unit cells around whole coordinates hold a dot
/// of radius 0.35, at a random position inside the cell.
bool inside_dot(Vec2 st);

/// pbrt-v4's "marble": a spline of colours along y, bent by `variation` times fractal noise; `p` has been scaled by the
/// caller. Every channel lies in [0.3, 0.9].
Rgb marble(const Vec3& p, float omega, int octaves, float variation);

}  // namespace lightloom
