#pragma once
// Tables behind the coats: directional albedos of a rough dielectric interface over angle and roughness, one table per
// index of refraction, computed by fixed quadrature when an index is first seen. They depend on nothing but the index.

#include <algorithm>
#include <cmath>

#include "common/scene/bsdf.h"

namespace lightloom {

/// A function of (|cos|, alpha): linear between knots that are equidistant in sqrt(|cos|) and in the fourth root of alpha
/// (from the least rough alpha on), which puts them where the albedo bends: where |cos| and alpha are alike.
struct DirectionalTable {
    static constexpr int kCosines = 96;
    static constexpr int kAlphas = 80;
    static constexpr float kFirstRoot = 0.17f;  ///< alpha = 8.4e-4, below which interfaces are smooth.
    float values[kAlphas][kCosines];
    /// Cosine-weighted mean over the hemisphere of the row as interpolated, exact.
    float means[kAlphas];
    /// The same for alpha = 0, without interpolation: smooth coats evaluate Fresnel's equations instead of looking up.
    float smooth_mean;

    /// `alpha` is moved into the table's range, which ends at 1.
    TableRows rows(float alpha) const {
        int row;
        const float fraction = locate(alpha, &row);
        return {values[row], fraction};
    }
    float mean(float alpha) const {
        int row;
        const float fraction = locate(alpha, &row);
        return lerp(fraction, means[row], means[row + 1]);
    }

  private:
    static float locate(float alpha, int* row) {
        const float root = clamp(std::sqrt(std::sqrt(alpha)), kFirstRoot, 1.0f);
        const float x = (root - kFirstRoot) * ((kAlphas - 1) / (1 - kFirstRoot));
        *row = std::min(int(x), kAlphas - 2);
        return x - float(*row);
    }
};

inline float look_up(const TableRows& table, float cos) {
    const float x = std::sqrt(std::min(cos, 1.0f)) * (DirectionalTable::kCosines - 1);
    const int i = std::min(int(x), DirectionalTable::kCosines - 2);
    const float* p = table.rows + i;
    const float* q = p + DirectionalTable::kCosines;
    const float t = x - float(i);
    return lerp(table.fraction, lerp(t, p[0], p[1]), lerp(t, q[0], q[1]));
}

/// 2 integral of (1 - a(c)) b(c) c dc over [0, 1], by the trapezoidal rule on the knots.
float cosine_mean_of_product(const TableRows& a, const TableRows& b);

/// Share of the light arriving at the interface from outside that it reflects (single scattering). Thread-safe; builds the
/// table at the first call for an `eta`, after that it is a walk over the few indices of a scene.
const DirectionalTable& coat_albedo_table(float eta);

/// A perfectly reflecting rough base under a smooth interface: the share of the light that it reflects beyond the critical
/// angle, over the cosine outside of the light that came in. Zero for eta <= 1. Thread-safe in the same way.
const DirectionalTable& trapped_table(float eta);

}  // namespace lightloom
