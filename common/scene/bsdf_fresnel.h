#pragma once
// Fresnel reflectances, unpolarised.

#include <immintrin.h>

#include <cmath>

#include "common/core/vec.h"

namespace lightloom {

/// Reflectance of a dielectric from the cosines on both sides, which obey Snell's law, and eta, the index on cos_t's
/// side over the other's. Scale-invariant: both cosines may carry the same positive factor.
inline float fresnel_from_cosines(float cos_i, float cos_t, float eta) {
    const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

struct DielectricFresnel {
    float reflectance = 1;
    float cos_t = 0;  ///< Positive; 0 for total internal reflection.
    float eta = 1;    ///< Index on the transmitted side over that on the incident side.
};

/// `cos_i` is signed: positive above the interface. `eta` is the index below over that above. The reflectance is 1 at
/// grazing incidence; for eta == 1 it is 0 everywhere.
inline DielectricFresnel fresnel_dielectric(float cos_i, float eta) {
    if (cos_i < 0) {
        eta = 1 / eta;
        cos_i = -cos_i;
    }
    if (eta == 1) return {0, cos_i, 1};
    const float cos2_t = 1 - (1 - cos_i * cos_i) / (eta * eta);
    if (!(cos2_t > 0)) return {1, 0, eta};
    const float cos_t = std::sqrt(cos2_t);
    return {fresnel_from_cosines(cos_i, cos_t, eta), cos_t, eta};
}

/// Conductor with relative index eta + i k, 0 <= cos_i <= 1; exact, in real arithmetic. The three channels share vector
/// instructions, because this is the most expensive part of a metal's evaluation.
inline Rgb fresnel_conductor(float cos_i, const Rgb& eta, const Rgb& k) {
    const auto all = [](float v) { return _mm_set1_ps(v); };
    const __m128 n = _mm_setr_ps(eta.r, eta.g, eta.b, 1), kk = _mm_setr_ps(k.r, k.g, k.b, 1);
    const __m128 cos2 = all(cos_i * cos_i), sin2 = all(1 - cos_i * cos_i), nk = n * kk;
    const __m128 t = n * n - kk * kk - sin2;
    const __m128 modulus = _mm_sqrt_ps(t * t + all(4) * nk * nk);  // |n^2 - sin^2|
    // Re sqrt(n^2 - sin^2), in the form that does not cancel.
    const __m128 abs_t = _mm_andnot_ps(all(-0.0f), t);
    const __m128 v = _mm_sqrt_ps(all(0.5f) * (modulus + abs_t));
    const __m128 re = _mm_blendv_ps(v, nk / v, t);
    // Perpendicular (s - q) / (s + q); parallel is that times (p - q sin^2) / (p + q sin^2); and their mean.
    const __m128 s = modulus + cos2, q = all(2 * cos_i) * re, p = cos2 * modulus + sin2 * sin2;
    const __m128 denominator = (s + q) * (p + q * sin2);
    // The denominator vanishes only where the index does; then no wave enters.
    const __m128 valid = _mm_cmpgt_ps(denominator, all(0));
    float out[4];
    _mm_storeu_ps(out, _mm_blendv_ps(all(1), (s - q) * p / denominator, valid));
    return {out[0], out[1], out[2]};
}
inline float fresnel_conductor(float cos_i, float eta, float k) { return fresnel_conductor(cos_i, Rgb(eta), Rgb(k)).r; }

}  // namespace lightloom
