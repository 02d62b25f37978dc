#pragma once
// Fresnel reflectances, unpolarised.

#include <cmath>

#include "common/core/vec.h"

namespace lightloom {

/// Dielectric, from the cosines on both sides (Snell's law holds between them) and eta = index on cos_t's side over the
/// other's. Scale-invariant: both cosines may carry the same positive factor.
inline float fresnel_from_cosines(float cos_i, float cos_t, float eta) {
    const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

struct DielectricFresnel {
    float reflectance = 1;
    float cos_t = 0;     ///< Positive; 0 for total internal reflection.
    float eta = 1;       ///< Index on the transmitted side over that on the incident side.
};

/// `cos_i` is signed: positive above the interface. `eta`: index below over above. Reflectance 1 at grazing incidence, for
/// eta == 1 it is 0 everywhere.
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

/// Conductor with relative index eta + i k, 0 <= cos_i <= 1; exact, in real arithmetic.
inline float fresnel_conductor(float cos_i, float eta, float k) {
    const float cos2 = cos_i * cos_i, sin2 = 1 - cos2;
    const float t = eta * eta - k * k - sin2;
    const float modulus = std::sqrt(t * t + 4 * eta * eta * k * k);  // |n^2 - sin^2|
    // Re sqrt(n^2 - sin^2), by whichever form does not cancel.
    const float a = t >= 0 ? std::sqrt(0.5f * (modulus + t)) : eta * k / std::sqrt(0.5f * (modulus - t));
    const float s = modulus + cos2, cross_s = 2 * cos_i * a;
    const float p = cos2 * modulus + sin2 * sin2, cross_p = cross_s * sin2;
    // s + cross_s == 0 only for eta = k = 0 at grazing incidence: no wave enters.
    if (!(s + cross_s > 0) || !(p + cross_p > 0)) return 1;
    const float rs = (s - cross_s) / (s + cross_s);
    const float rp = rs * ((p - cross_p) / (p + cross_p));
    return 0.5f * (rs + rp);
}

inline Rgb fresnel_conductor(float cos_i, const Rgb& eta, const Rgb& k) {
    return {fresnel_conductor(cos_i, eta.r, k.r), fresnel_conductor(cos_i, eta.g, k.g),
            fresnel_conductor(cos_i, eta.b, k.b)};
}

}  // namespace lightloom
