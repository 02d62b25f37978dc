#pragma once
// GGX microfacets with height-correlated Smith masking-shadowing [Walter et al. 2007; Heitz 2014], written without the
// divisions by cosines that make the textbook form fragile at grazing angles. With
//     s(w) = sqrt(z^2 + (alpha_x x)^2 + (alpha_y y)^2)   and   q(h) = (x / alpha_x)^2 + (y / alpha_y)^2 + z^2
// (h need not be normalised) one has
//     1 + Lambda(w) = (s + |z|) / (2 |z|),   G2 / (4 |zo zi|) = 1 / (2 (so |zi| + si |zo|)),
//     D(h / |h|) = |h|^4 / (pi alpha_x alpha_y q^2),
// so that value and both visible-normal densities share q, so and si.

#include "common/core/math.h"
#include "common/core/vec.h"

namespace lightloom {

struct Ggx {
    float alpha_x, alpha_y;

    /// s(w) as above; equals |z| for a smooth surface.
    float slope_length(const Vec3& w) const {
        const float x = alpha_x * w.x, y = alpha_y * w.y;
        return std::sqrt(w.z * w.z + (x * x + y * y));
    }
    /// D(h / |h|) / |h|^4, 1/sr.
    float scaled_density(const Vec3& h) const {
        const float x = h.x / alpha_x, y = h.y / alpha_y;
        const float q = x * x + y * y + h.z * h.z;
        return kInvPi / (alpha_x * alpha_y * q * q);
    }
    /// A normal (z > 0) visible from `w`, which must lie above the surface; its density is the visible-normal
    /// distribution G1(w) max(0, w.m) D(m) / w.z. [Dupuy and Benyoub 2023, spherical caps]. Zero vector when degenerate.
    Vec3 sample_visible_normal(const Vec3& w, Vec2 u) const {
        const Vec3 standard = normalize(Vec3{alpha_x * w.x, alpha_y * w.y, w.z});
        const math::SinCos azimuth = math::sincos_turns(u.x);
        const float z = (1 - u.y) * (1 + standard.z) - standard.z;
        const float radius = safe_sqrt(1 - z * z);
        const Vec3 h{radius * float(azimuth.cos) + standard.x, radius * float(azimuth.sin) + standard.y, z + standard.z};
        const Vec3 m{alpha_x * h.x, alpha_y * h.y, h.z > 0 ? h.z : 0.0f};
        const float length2 = length_squared(m);
        return length2 > 0 ? m / std::sqrt(length2) : Vec3{};
    }
};

/// Below this, both directions are so close to the horizon that f, which grows like 1 / cos there, would exceed float's
/// range.
inline constexpr float kLeastDenominator = 1e-30f;

/// Value and densities of a reflecting microfacet lobe, for wo and wi above the surface.
struct MicrofacetReflection {
    float value = 0;    ///< D G2 / (4 cos cos): the BRDF without Fresnel.
    float pdf_fwd = 0;  ///< Solid-angle density of wi: visible normal at wo, then mirrored.
    float pdf_rev = 0;
    float cos_h = 0;  ///< Cosine between either direction and the half vector.
};

inline MicrofacetReflection microfacet_reflection(const Ggx& ggx, const Vec3& wo, const Vec3& wi) {
    const Vec3 h = wo + wi;
    const float h2 = length_squared(h);
    const float so = ggx.slope_length(wo), si = ggx.slope_length(wi);
    const float denominator = so * wi.z + si * wo.z;
    if (!(denominator > kLeastDenominator) || !(h2 > 0)) return {};
    const float half_density = 0.5f * h2 * h2 * ggx.scaled_density(h);
    const float cos_h = 0.5f * std::sqrt(h2);
    return {half_density / denominator, half_density / (so + wo.z), half_density / (si + wi.z), cos_h < 1 ? cos_h : 1.0f};
}

/// A surface with both alphas below this is a mirror, as in pbrt.
inline constexpr float kSmoothAlpha = 1e-3f;
/// Smallest alpha along one axis of an anisotropic rough surface, as in pbrt.
inline constexpr float kLeastAlpha = 1e-4f;

inline Ggx regularised(float alpha_x, float alpha_y) {
    // NaN counts as smooth.
    if (!(alpha_x >= kSmoothAlpha) && !(alpha_y >= kSmoothAlpha)) return {0, 0};
    return {alpha_x > kLeastAlpha ? alpha_x : kLeastAlpha, alpha_y > kLeastAlpha ? alpha_y : kLeastAlpha};
}

}  // namespace lightloom
