#pragma once
// Sampling of discrete distributions and of shapes.

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/math.h"
#include "common/core/vec.h"

namespace lightloom {

/// One of `count` equal parts of the unit interval: below `keep` it belongs to its own index, above to another.
struct AliasEntry {
    float pmf = 0;
    float keep = 1;
    uint32_t alias = 0;
};

/// Fills in weights.size() `entries`. Weights are as for AliasTable.
void make_alias(std::span<const double> weights, AliasEntry* entries);
/// The part that `u` in [0, 1) falls into.
inline uint32_t alias_part(uint32_t count, double u) {
    const uint32_t i = uint32_t(u * double(count));
    return i < count ? i : count - 1;
}

/// Discrete distribution with O(1) sampling [Walker 1974; Vose 1991]. pmf() is exactly what sample() does up to the
/// rounding of the alias table, because both are derived from the same normalised doubles.
class AliasTable {
  public:
    AliasTable() = default;
    /// Weights must be finite and non-negative; all zero means uniform.
    explicit AliasTable(std::span<const double> weights);

    size_t size() const { return entries_.size(); }
    bool empty() const { return entries_.empty(); }
    float pmf(size_t i) const { return entries_[i].pmf; }
    /// `u` in [0, 1); `remapped`, when given, receives a new uniform number in [0, 1).
    uint32_t sample(double u, float* remapped = nullptr) const;

  private:
    /// A draw needs one cache line, because the table of an environment map is far larger than any cache.
    std::vector<AliasEntry> entries_;
};

/// Uniform on the unit disk, concentric mapping [Shirley and Chiu 1997].
Vec2 sample_disk(Vec2 u);
/// Uniform on the unit sphere; density 1 / (4 pi).
Vec3 sample_sphere(Vec2 u);
/// Cosine-weighted on the upper hemisphere (z up); density cos / pi. `u` in [0, 1)^2, polar mapping.
inline Vec3 sample_cosine_hemisphere(Vec2 u) {
    const math::SinCos azimuth = math::sincos_turns(u.x);
    const float radius = std::sqrt(u.y);
    return {radius * float(azimuth.cos), radius * float(azimuth.sin), std::sqrt(1 - u.y)};
}
/// The same by sample_disk(), which keeps more neighbours together; for stratified points.
Vec3 sample_cosine_hemisphere_concentric(Vec2 u);
/// Uniform barycentric weights (b1, b2) of a triangle.
Vec2 sample_triangle(Vec2 u);

/// Solid angles, sr, of columns x rows equal cells of [-half_width, half_width] x [-half_height, half_height] at distance 1, row by
/// row.
std::vector<double> projected_solid_angles(int columns, int rows, double half_width, double half_height);

/// Equal-area octahedral mapping between [0,1]^2 and the sphere [Clarberg 2008], pbrt-v4's orientation.
Vec3 equal_area_square_to_sphere(Vec2 p);
Vec2 equal_area_sphere_to_square(const Vec3& d);

}  // namespace lightloom
