// Conductors: GGX over the exact complex Fresnel reflectance, or a mirror.

#include "common/scene/bsdf_families.h"
#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"

namespace lightloom {

Rgb conductor_k(const Rgb& reflectance) {
    const auto k = [](float r) {
        r = clamp(r, 0.0f, 0.9999f);
        return 2 * std::sqrt(r) / std::sqrt(1 - r);
    };
    return {k(reflectance.r), k(reflectance.g), k(reflectance.b)};
}

Bsdf make_conductor(const Rgb& eta, const Rgb& k, float alpha_x, float alpha_y) {
    Bsdf b;
    b.kind = BsdfKind::kConductor;
    b.black = false;
    const Ggx ggx = regularised(alpha_x, alpha_y);
    b.alpha_x = ggx.alpha_x;
    b.alpha_y = ggx.alpha_y;
    b.reflectance = eta;
    b.transmittance = k;
    return b;
}

namespace bsdf_families {

BsdfEval eval_conductor(const Bsdf& b, Vec3 wo, Vec3 wi) {
    if (b.alpha_x == 0 || !to_upper_side(&wo, &wi)) return {};
    const MicrofacetReflection m = microfacet_reflection({b.alpha_x, b.alpha_y}, wo, wi);
    return {fresnel_conductor(m.cos_h, b.reflectance, b.transmittance) * m.value, m.pdf_fwd, m.pdf_rev};
}

bool sample_conductor(const Bsdf& b, Vec3 wo, Vec2 u, BsdfSample* out) {
    if (wo.z == 0) return false;
    if (b.alpha_x == 0) {
        const Rgb fresnel = fresnel_conductor(std::fabs(wo.z), b.reflectance, b.transmittance);
        return finish_delta({-wo.x, -wo.y, wo.z}, fresnel, 1, out);
    }
    const float side = wo.z < 0 ? -1.0f : 1.0f;
    wo.z = std::fabs(wo.z);
    const Ggx ggx{b.alpha_x, b.alpha_y};
    Vec3 wi = mirrored(wo, ggx.sample_visible_normal(wo, u));
    if (!(wi.z > 0) || !finish(eval_conductor(b, wo, wi), wi, out)) return false;
    out->wi.z *= side;
    return true;
}

}  // namespace bsdf_families
}  // namespace lightloom
