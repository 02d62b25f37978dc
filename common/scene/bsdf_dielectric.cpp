// Dielectric interfaces. Rough ones are Walter et al. 2007 with height-correlated masking, chosen between reflection and
// refraction by the Fresnel reflectance of the sampled microfacet, as in pbrt-v4. With the unnormalised half vector
// h = wo + etap wi (etap = index on wi's side over that on wo's) refraction needs no length of h at all:
//     f_importance = 2 (1 - F) etap^2 |wo.h wi.h| / (pi alpha_x alpha_y q(h)^2 (so |zi| + si |zo|)),
// and the densities differ from it only in the last factor (see bsdf_microfacet.h for s and q).

#include <algorithm>

#include "common/scene/bsdf_families.h"
#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"

namespace lightloom {

Bsdf make_dielectric(float eta, float alpha_x, float alpha_y) {
    Bsdf b;
    b.kind = BsdfKind::kDielectric;
    b.black = false;
    b.eta = eta;
    const Ggx ggx = eta == 1 ? Ggx{0, 0} : regularised(alpha_x, alpha_y);
    b.alpha_x = ggx.alpha_x;
    b.alpha_y = ggx.alpha_y;
    return b;
}

Bsdf make_thin_dielectric(float eta) {
    Bsdf b;
    b.kind = BsdfKind::kThinDielectric;
    b.black = false;
    b.eta = eta;
    return b;
}

namespace bsdf_families {

BsdfEval eval_dielectric(const Bsdf& b, const Vec3& wo, const Vec3& wi, TransportMode mode) {
    const float zo = std::fabs(wo.z), zi = std::fabs(wi.z);
    if (b.alpha_x == 0 || !(zo > 0) || !(zi > 0)) return {};
    const Ggx ggx{b.alpha_x, b.alpha_y};
    const bool reflect = (wo.z > 0) == (wi.z > 0);
    const float etap = reflect ? 1 : (wo.z > 0 ? b.eta : 1 / b.eta);
    const Vec3 h = wo + etap * wi;
    const float so = ggx.slope_length(wo), si = ggx.slope_length(wi);
    const float oh = dot(wo, h), ih = dot(wi, h);
    // A facet must be visible from both directions.
    const float up = h.z > 0 ? 1.0f : -1.0f;
    if (!(up * oh * wo.z > 0) || !(up * ih * wi.z > 0)) return {};
    const float denominator = so * zi + si * zo;
    if (!(denominator > kLeastDenominator)) return {};

    if (reflect) {
        const float h2 = length_squared(h);
        // wo.m = |h| / 2, below the surface with the sign of the lower side.
        const float cos_h = std::min(0.5f * std::sqrt(h2), 1.0f);
        const float fresnel = fresnel_dielectric(wo.z > 0 ? cos_h : -cos_h, b.eta).reflectance;
        const float base = 0.5f * fresnel * h2 * h2 * ggx.scaled_density(h);
        return {Rgb(base / denominator), base / (so + zo), base / (si + zi)};
    }
    const float abs_oh = std::fabs(oh), abs_ih = std::fabs(ih);
    const float fresnel = fresnel_from_cosines(abs_oh, abs_ih, etap);
    const float base = 2 * (1 - fresnel) * abs_oh * abs_ih * ggx.scaled_density(h);
    const float etap2 = etap * etap;
    const float f = mode == TransportMode::kRadiance ? base / denominator : base * etap2 / denominator;
    return {Rgb(f), base * etap2 / (so + zo), base / (si + zi)};
}

bool sample_dielectric(const Bsdf& b, const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) {
    if (wo.z == 0) return false;
    const bool smooth = b.alpha_x == 0;
    const float side = wo.z > 0 ? 1.0f : -1.0f;
    // From here on directions are on the upper side, and the index is the one seen from there.
    const Vec3 w{wo.x, wo.y, std::fabs(wo.z)};
    const Vec3 m = smooth ? Vec3{0, 0, 1} : Ggx{b.alpha_x, b.alpha_y}.sample_visible_normal(w, u);
    const float cos_m = dot(w, m);
    const DielectricFresnel fresnel = fresnel_dielectric(side * cos_m, b.eta);
    const bool reflect = lobe < fresnel.reflectance;
    Vec3 wi = reflect ? mirrored(w, m) : m * (cos_m / fresnel.eta - fresnel.cos_t) - w / fresnel.eta;
    if (reflect ? !(wi.z > 0) : !(wi.z < 0)) return false;
    wi.z *= side;
    if (!smooth) return finish(eval_dielectric(b, wo, wi, mode), wi, out);
    if (reflect) return finish_delta(wi, Rgb(1), fresnel.reflectance, out);
    const float scale = mode == TransportMode::kRadiance ? 1 / (fresnel.eta * fresnel.eta) : 1.0f;
    return finish_delta(wi, Rgb(scale), 1 - fresnel.reflectance, out);
}

bool sample_thin_dielectric(const Bsdf& b, const Vec3& wo, float lobe, BsdfSample* out) {
    if (wo.z == 0) return false;
    // Both interfaces: R + T^2 R (1 + R^2 + ...) = 2 R / (1 + R).
    const float single = fresnel_dielectric(std::fabs(wo.z), b.eta).reflectance;
    const float reflectance = 2 * single / (1 + single);
    if (lobe < reflectance) return finish_delta({-wo.x, -wo.y, wo.z}, Rgb(1), reflectance, out);
    return finish_delta(-wo, Rgb(1), 1 - reflectance, out);
}

}  // namespace bsdf_families
}  // namespace lightloom
