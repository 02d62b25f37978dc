// Analytic layering of a dielectric coat over a base, in place of pbrt's random walk between the layers: the same light, but
// cheap, symmetric and with exact densities. A(w) is the share of the light from w that gets down to the base: Fresnel's
// equations for a smooth coat, a table for a rough one, and the slab's transmittance (pbrt's coats absorb exp(-thickness/cos)
// on every crossing, 0.01 by default). By reciprocity A(w) / eta^2 is also the share of the base's light that leaves along w.
//
// A Lambertian base forgets where light came from, so that with r, the share of its light that the coat returns to it, the
// walk is a geometric series [Saunderson 1942]:
//     f = f_coat + A(wo) A(wi) rho / (pi eta^2 (1 - rho r)).
// This IS the mean of pbrt's walk. pbrt's walk ends after "maxdepth" events (10: five at the base), and so does the series
// with n base bounces: 1 - (rho r)^n of it. A smooth coat without thickness and with the endless series is a furnace at
// rho = 1. Rough interfaces scatter once and lose what they shadow, as in pbrt;
// the loss is large (a coat of alpha 0.25 over albedo 0.7 absorbs a fifth), so that scenes are made to look right with it.
//
// Over a conductor with microfacet lobe f_base, whose mean reflectance is R, in directions w' refracted by Snell's law:
//     f = f_coat + A(wo) A(wi) / eta^2 f_base(wo', wi') / (1 - g F) + C A(wo) W(wo) A(wi) W(wi),   g = min(E(wo), E(wi)).
// The second term is the directional series, E being what the coat reflects (exact when all is smooth; g <= E(wi) keeps the
// energy); W(w) is the share of the base's reflection beyond the critical angle, which comes out as a diffuse lobe after at
// least one more bounce, with C such that its albedo is A W R^2 (1 - r) / (1 - R r). A rough coat also blurs what passes
// through it: tilts of variance alpha^2 on the way in and out count as a wider base, alpha_base^2 + (1 - 1/eta)^2 alpha^2 / 2.
// Against pbrt's walk this is exact for smooth layers and a model for rough ones (tests/unit/bsdf_test.cpp states how close).
//
// Lobes are chosen by albedos that are functions of one direction: every density includes that pmf.

#include <algorithm>

#include "common/scene/bsdf_families.h"
#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"
#include "common/scene/bsdf_tables.h"

namespace lightloom {
namespace {

/// Fills the coat's fields; returns r, the share of diffuse light from the base that it sends back.
float make_coat(Bsdf* b, float eta, float thickness, float alpha_x, float alpha_y) {
    b->black = false;
    b->eta = eta;
    b->thickness = thickness > 0 ? thickness : 0.0f;
    const Ggx ggx = eta == 1 ? Ggx{0, 0} : regularised(alpha_x, alpha_y);
    b->alpha_x = ggx.alpha_x;
    b->alpha_y = ggx.alpha_y;
    const DirectionalTable& table = coat_table(eta, b->thickness);
    const float alpha = std::sqrt(ggx.alpha_x * ggx.alpha_y);
    b->coat_transmission = table.rows(alpha);
    return table.at_alpha(alpha);
}

struct CoatSide {
    float transmitted;  ///< A.
    float reflected;    ///< E; a rough coat's includes its losses, which matter for the choice of lobes only.
};

/// `cos` is the cosine outside the coat.
CoatSide coat_side(const Bsdf& b, float cos) {
    if (b.alpha_x > 0) {
        const float transmitted = look_up(b.coat_transmission, cos);
        return {transmitted, 1 - transmitted};
    }
    const DielectricFresnel f = fresnel_dielectric(cos, b.eta);
    return {(1 - f.reflectance) * slab_transmittance(b.thickness, f.cos_t), f.reflectance};
}

/// w' inside the coat, on the same side; z = 0 where nothing is transmitted (only for eta < 1).
Vec3 refracted(const Vec3& w, float eta) {
    const float inv = 1 / eta, x = w.x * inv, y = w.y * inv;
    return {x, y, safe_sqrt(1 - (x * x + y * y))};
}

/// Adds the rough coat's own lobe, whose pmf is `pmf_o` coming from wo and `pmf_i` coming from wi.
void add_coat_lobe(const Bsdf& b, const Vec3& wo, const Vec3& wi, float pmf_o, float pmf_i, BsdfEval* e) {
    const MicrofacetReflection m = microfacet_reflection({b.alpha_x, b.alpha_y}, wo, wi);
    const float f = m.value * fresnel_dielectric(m.cos_h, b.eta).reflectance;
    e->f += Rgb(f);
    e->pdf_fwd += pmf_o * m.pdf_fwd;
    e->pdf_rev += pmf_i * m.pdf_rev;
}

/// Probability of the coat's lobe over a Lambertian base.
float diffuse_coat_pmf(const Bsdf& b, const CoatSide& side) {
    const float base = side.transmitted * b.base_weight;
    return side.reflected + base > 0 ? side.reflected / (side.reflected + base) : 1.0f;
}

/// The values that the lobes of a coated conductor share for one direction.
struct ConductorSide {
    CoatSide coat;
    float trapped;             ///< W.
    float coat_pmf, base_pmf;  ///< The diffuse lobe takes the rest.
};

ConductorSide conductor_side(const Bsdf& b, const Vec3& w) {
    ConductorSide s;
    s.coat = coat_side(b, w.z);
    s.trapped = look_up(b.trapped, w.z);
    // A rough coat also transmits light beyond the critical angle, but without a refracted direction the base's lobe
    // has no value there, so that it must not be drawn either.
    const float base = refracted(w, b.eta).z > 0 ? s.coat.transmitted * b.base_weight * (1 - s.trapped) : 0.0f;
    const float diffuse = s.coat.transmitted * s.trapped * b.trapped_reflectance.average();
    const float sum = s.coat.reflected + base + diffuse;
    s.coat_pmf = sum > 0 ? s.coat.reflected / sum : 1.0f;
    s.base_pmf = sum > 0 ? base / sum : 0.0f;
    return s;
}

}  // namespace

Bsdf make_coated_diffuse(const Rgb& reflectance, float eta, float thickness, float alpha_x, float alpha_y, int base_bounces) {
    Bsdf b;
    b.kind = BsdfKind::kCoatedDiffuse;
    const float r = make_coat(&b, eta, thickness, alpha_x, alpha_y);
    const auto base = [r, eta, base_bounces](float rho) {
        rho = clamp(rho, 0.0f, 1.0f);
        float rest = base_bounces > 0 ? 1.0f : 0.0f;  // (rho r)^n, what the endless series has beyond n bounces
        for (int i = 0; i < base_bounces; ++i) rest *= rho * r;
        return rho * (1 - rest) / (eta * eta * (1 - rho * r));
    };
    // Stored so that the base's lobe is A(wo) A(wi) reflectance / pi.
    b.reflectance = {base(reflectance.r), base(reflectance.g), base(reflectance.b)};
    b.base_weight = b.reflectance.average();
    return b;
}

Bsdf make_coated_conductor(const Rgb& conductor_eta, const Rgb& conductor_k, float base_alpha_x, float base_alpha_y, float eta,
                           float thickness, float alpha_x, float alpha_y) {
    Bsdf b;
    b.kind = BsdfKind::kCoatedConductor;
    const float r = make_coat(&b, eta, thickness, alpha_x, alpha_y);
    b.reflectance = conductor_eta / eta;
    b.transmittance = conductor_k / eta;
    const auto blurred = [eta](float base_alpha, float coat_alpha) {
        const float wide = std::sqrt(sqr(base_alpha) + 0.5f * sqr((1 - 1 / eta) * coat_alpha));
        return coat_alpha > 0 ? std::max(wide, kSmoothAlpha) : wide;
    };
    const Ggx base = regularised(blurred(base_alpha_x, b.alpha_x), blurred(base_alpha_y, b.alpha_y));
    b.base_alpha_x = base.alpha_x;
    b.base_alpha_y = base.alpha_y;
    // The mean reflectance of the base is taken as Fresnel's at the mean cosine, 2/3.
    const Rgb mean = fresnel_conductor(2.0f / 3, b.reflectance, b.transmittance);
    b.base_weight = mean.average();
    if (base.alpha_x == 0) return b;
    const float alpha = std::sqrt(base.alpha_x * base.alpha_y);
    b.trapped = trapped_table(eta).rows(alpha);
    const auto scattered = [r](float m) { return m * m * (1 - r) / (1 - m * r); };
    b.trapped_reflectance = {scattered(mean.r), scattered(mean.g), scattered(mean.b)};
    const float integral = cosine_mean_of_product(b.coat_transmission, b.trapped);  // 1 / C
    b.trapped_norm = integral > 0 ? 1 / integral : 0.0f;
    return b;
}

namespace bsdf_families {

BsdfEval eval_coated_diffuse(const Bsdf& b, Vec3 wo, Vec3 wi) {
    if (!to_upper_side(&wo, &wi)) return {};
    const CoatSide o = coat_side(b, wo.z), i = coat_side(b, wi.z);
    const float pmf_o = diffuse_coat_pmf(b, o), pmf_i = diffuse_coat_pmf(b, i);
    BsdfEval e{b.reflectance * (o.transmitted * i.transmitted * kInvPi), (1 - pmf_o) * wi.z * kInvPi, (1 - pmf_i) * wo.z * kInvPi};
    if (b.alpha_x > 0) add_coat_lobe(b, wo, wi, pmf_o, pmf_i, &e);
    return e;
}

bool sample_coated_diffuse(const Bsdf& b, Vec3 wo, float lobe, Vec2 u, BsdfSample* out) {
    if (wo.z == 0) return false;
    const float side = wo.z < 0 ? -1.0f : 1.0f;
    wo.z = std::fabs(wo.z);
    const CoatSide coat = coat_side(b, wo.z);
    const float pmf = diffuse_coat_pmf(b, coat);
    Vec3 wi;
    if (lobe >= pmf) {
        wi = sample_cosine_hemisphere(u);
    } else if (b.alpha_x == 0) {
        return finish_delta({-wo.x, -wo.y, side * wo.z}, Rgb(coat.reflected / pmf), pmf, out);
    } else {
        wi = mirrored(wo, Ggx{b.alpha_x, b.alpha_y}.sample_visible_normal(wo, u));
    }
    if (!(wi.z > 0) || !finish(eval_coated_diffuse(b, wo, wi), wi, out)) return false;
    out->wi.z *= side;
    return true;
}

BsdfEval eval_coated_conductor(const Bsdf& b, Vec3 wo, Vec3 wi) {
    if (b.base_alpha_x == 0 || !to_upper_side(&wo, &wi)) return {};
    const ConductorSide o = conductor_side(b, wo), i = conductor_side(b, wi);
    const float t2 = o.coat.transmitted * i.coat.transmitted;
    BsdfEval e;
    e.f = b.trapped_reflectance * (t2 * o.trapped * i.trapped * b.trapped_norm * kInvPi);
    e.pdf_fwd = (1 - o.coat_pmf - o.base_pmf) * wi.z * kInvPi;
    e.pdf_rev = (1 - i.coat_pmf - i.base_pmf) * wo.z * kInvPi;
    if (b.alpha_x > 0) add_coat_lobe(b, wo, wi, o.coat_pmf, i.coat_pmf, &e);

    const Vec3 inner_o = refracted(wo, b.eta), inner_i = refracted(wi, b.eta);
    if (!(inner_o.z > 0) || !(inner_i.z > 0)) return e;
    const MicrofacetReflection m = microfacet_reflection({b.base_alpha_x, b.base_alpha_y}, inner_o, inner_i);
    const Rgb fresnel = fresnel_conductor(m.cos_h, b.reflectance, b.transmittance);
    const float g = std::min(o.coat.reflected, i.coat.reflected), inv_eta2 = 1 / (b.eta * b.eta);
    const float scale = t2 * inv_eta2 * m.value;
    e.f += Rgb(scale * fresnel.r / (1 - g * fresnel.r), scale * fresnel.g / (1 - g * fresnel.g),
               scale * fresnel.b / (1 - g * fresnel.b));
    // d(inner solid angle) / d(outer) = cos / (eta^2 cos').
    e.pdf_fwd += o.base_pmf * m.pdf_fwd * inv_eta2 * wi.z / inner_i.z;
    e.pdf_rev += i.base_pmf * m.pdf_rev * inv_eta2 * wo.z / inner_o.z;
    return e;
}

bool sample_coated_conductor(const Bsdf& b, Vec3 wo, float lobe, Vec2 u, BsdfSample* out) {
    if (wo.z == 0) return false;
    const float side = wo.z < 0 ? -1.0f : 1.0f;
    wo.z = std::fabs(wo.z);
    if (b.base_alpha_x == 0) {
        // Everything is smooth: one direction holds the whole series.
        const CoatSide coat = coat_side(b, wo.z);
        const float cos = refracted(wo, b.eta).z, t2 = sqr(coat.transmitted);
        const float returned = coat.reflected * sqr(slab_transmittance(b.thickness, cos));
        const Rgb base = fresnel_conductor(cos, b.reflectance, b.transmittance);
        const auto series = [=](float r) { return t2 > 0 ? coat.reflected + t2 * r / (1 - returned * r) : coat.reflected; };
        return finish_delta({-wo.x, -wo.y, side * wo.z}, {series(base.r), series(base.g), series(base.b)}, 1, out);
    }
    const ConductorSide o = conductor_side(b, wo);
    Vec3 wi;
    if (lobe < o.coat_pmf) {
        if (b.alpha_x == 0) return finish_delta({-wo.x, -wo.y, side * wo.z}, Rgb(o.coat.reflected / o.coat_pmf), o.coat_pmf, out);
        wi = mirrored(wo, Ggx{b.alpha_x, b.alpha_y}.sample_visible_normal(wo, u));
    } else if (lobe < o.coat_pmf + o.base_pmf) {
        const Vec3 inner = refracted(wo, b.eta);
        const Vec3 mirror = mirrored(inner, Ggx{b.base_alpha_x, b.base_alpha_y}.sample_visible_normal(inner, u));
        const Vec3 outer{mirror.x * b.eta, mirror.y * b.eta, 0};
        // Light beyond the critical angle does not get out here; the third lobe accounts for it.
        const float sin2 = outer.x * outer.x + outer.y * outer.y;
        if (!(mirror.z > 0) || !(sin2 < 1)) return false;
        wi = {outer.x, outer.y, std::sqrt(1 - sin2)};
    } else {
        wi = sample_cosine_hemisphere(u);
    }
    if (!(wi.z > 0) || !finish(eval_coated_conductor(b, wo, wi), wi, out)) return false;
    out->wi.z *= side;
    return true;
}

}  // namespace bsdf_families
}  // namespace lightloom
