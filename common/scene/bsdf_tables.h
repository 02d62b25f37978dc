#pragma once
// Tables behind the coats: how much light a rough dielectric interface lets through, over angle and roughness. One
// table per index of refraction and thickness, computed by fixed quadrature when the pair first occurs; it depends on
// nothing else.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/scene/bsdf.h"

namespace lightloom {

/// A function of (|cos|, alpha): linear between knots that are equidistant in sqrt(|cos|) and in the fourth root of
/// alpha (from the least rough alpha on), which puts them where the albedo bends: where |cos| and alpha are similar.
struct DirectionalTable {
    static constexpr int kCosines = 96;
    static constexpr int kAlphas = 80;
    static constexpr float kFirstRoot = 0.17f;  ///< alpha = 8.4e-4, below which interfaces are smooth.
    float values[kAlphas][kCosines];
    /// A second function, which depends on alpha alone.
    float per_alpha[kAlphas];
    /// The same for alpha = 0, where per-direction values come from Fresnel's equations instead.
    float at_zero;

    /// `alpha` is clamped to the table's range, which ends at 1.
    TableRows rows(float alpha) const {
        int row;
        const float fraction = locate(alpha, &row);
        return {values[row], fraction};
    }
    float at_alpha(float alpha) const {
        if (alpha == 0) return at_zero;
        int row;
        const float fraction = locate(alpha, &row);
        return lerp(fraction, per_alpha[row], per_alpha[row + 1]);
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

/// 2 integral of a(c) b(c) c dc over [0, 1], by the trapezoidal rule on the knots.
float cosine_mean_of_product(const TableRows& a, const TableRows& b);

/// Share of the light that crosses a slab of optical thickness `thickness` at |cos|: exp(-thickness / |cos|) to 2e-7 for the
/// thin slabs of coats, and between 0 and 1 always.
inline float slab_transmittance(float thickness, float cos) {
    // 1 / (1 + x + x^2 / 2) with x = thickness / cos.
    const float cos2 = cos * cos;
    return cos2 > 0 ? cos2 / (cos2 + thickness * (cos + 0.5f * thickness)) : (thickness > 0 ? 0.0f : 1.0f);
}

/// values: share of the light arriving from outside that gets to the bottom of a coat of this index and optical
/// thickness (one scattering event at the rough interface, then the slab). per_alpha: share of diffuse light leaving
/// the bottom that the coat returns to it. Thread-safe; the first calls for given arguments build the table together (25
/// ms of processor time); later calls search the few coats of a scene.
const DirectionalTable& coat_table(float eta, float thickness);

/// values: the share of a perfectly reflecting rough base's reflection, under a smooth coat, that lies beyond the
/// critical angle, as a function of the incoming light's cosine outside the coat. Zero for eta <= 1. Thread-safe like
/// coat_table().
const DirectionalTable& trapped_table(float eta);

/// Rows of both kinds of tables that this process has computed, for tests.
uint64_t coat_table_rows_built();

}  // namespace lightloom
