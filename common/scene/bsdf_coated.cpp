// Analytic layering of a dielectric coat over a base, in place of pbrt's random walk between the layers: symmetric, energy
// conserving, with exact densities. E(w) is the coat's directional albedo (Fresnel's equations for a smooth coat, a table
// for a rough one), T = 1 - E, r = 1 - T_avg / eta^2 the mean reflectance of the coat from inside [Saunderson 1942].
//
// Over a Lambertian base of albedo rho, light inside is diffuse, and the inter-reflections are a geometric series:
//     f = f_coat + T(wo) T(wi) rho (1 - r) / (pi T_avg (1 - rho r)),        (1 - r) / T_avg = 1 / eta^2,
// which is a furnace at rho = 1: E + T = 1 whatever E is, so only the table's error remains. pbrt's walk stops after ten
// events and so loses a per cent or so of what white bases scatter.
//
// Over a conductor with microfacet lobe f_base, whose mean reflectance is R, in directions w' refracted by Snell's law:
//     f = f_coat + T(wo) T(wi) / eta^2 f_base(wo', wi') / (1 - g F) + C T(wo) W(wo) T(wi) W(wi),   g = min(E(wo), E(wi)).
// The second term is the directional series (exact when all is smooth; g <= E(wi) keeps the energy); W(w) is the share of
// the base's reflection beyond the critical angle, which comes out as a diffuse lobe after at least one more bounce, with
// C such that its albedo is T W R^2 (1 - r) / (1 - R r). A rough coat also blurs what passes through it: tilts of variance
// alpha^2 on the way in and out count as a wider base, alpha_base^2 + (1 - 1/eta)^2 alpha^2 / 2. Against pbrt's walk this
// is exact for smooth layers; rough ones lose the single-scattering loss of the base, as pbrt's do, and place inter-
// reflected light between the specular and the diffuse direction only by these two lobes.
//
// Lobes are chosen by their albedos, which are functions of one direction: every density includes that pmf.

#include <algorithm>

#include "common/scene/bsdf_families.h"
#include "common/scene/bsdf_fresnel.h"
#include "common/scene/bsdf_microfacet.h"
#include "common/scene/bsdf_tables.h"

namespace lightloom {
namespace {

/// Fills the coat's fields; returns T_avg.
float make_coat(Bsdf* b, float eta, float alpha_x, float alpha_y) {
    b->black = false;
    b->eta = eta;
    const Ggx ggx = eta == 1 ? Ggx{0, 0} : regularised(alpha_x, alpha_y);
    b->alpha_x = ggx.alpha_x;
    b->alpha_y = ggx.alpha_y;
    const DirectionalTable& table = coat_albedo_table(eta);
    const float alpha = std::sqrt(ggx.alpha_x * ggx.alpha_y);
    b->coat_albedo = table.rows(alpha);
    return 1 - (alpha == 0 ? table.smooth_mean : table.mean(alpha));
}

/// E(w), for the cosine outside.
float coat_albedo(const Bsdf& b, float cos) {
    return b.alpha_x == 0 ? fresnel_dielectric(cos, b.eta).reflectance : look_up(b.coat_albedo, cos);
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

/// Probability of the coat's lobe over a Lambertian base, given E.
float diffuse_coat_pmf(const Bsdf& b, float albedo) {
    const float base = (1 - albedo) * b.base_weight;
    return albedo + base > 0 ? albedo / (albedo + base) : 1.0f;
}

/// What the lobes of a coated conductor share for one direction.
struct ConductorSide {
    float albedo, transmitted, trapped;  ///< E, T, W.
    float coat_pmf, base_pmf;            ///< The diffuse lobe takes the rest.
};

ConductorSide conductor_side(const Bsdf& b, float cos) {
    ConductorSide s;
    s.albedo = coat_albedo(b, cos);
    s.transmitted = 1 - s.albedo;
    s.trapped = look_up(b.trapped, cos);
    const float base = s.transmitted * b.base_weight * (1 - s.trapped);
    const float diffuse = s.transmitted * s.trapped * b.trapped_reflectance.average();
    const float sum = s.albedo + base + diffuse;
    s.coat_pmf = sum > 0 ? s.albedo / sum : 1.0f;
    s.base_pmf = sum > 0 ? base / sum : 0.0f;
    return s;
}

}  // namespace

Bsdf make_coated_diffuse(const Rgb& reflectance, float eta, float alpha_x, float alpha_y) {
    Bsdf b;
    b.kind = BsdfKind::kCoatedDiffuse;
    const float t_mean = make_coat(&b, eta, alpha_x, alpha_y);
    const float r = clamp(1 - t_mean / (eta * eta), 0.0f, 1.0f);
    const auto base = [r, t_mean](float rho) {
        rho = clamp(rho, 0.0f, 1.0f);
        return t_mean > 0 ? rho * (1 - r) / (t_mean * (1 - rho * r)) : 0.0f;
    };
    // Stored so that the base's lobe is T(wo) T(wi) reflectance / pi.
    b.reflectance = {base(reflectance.r), base(reflectance.g), base(reflectance.b)};
    b.base_weight = b.reflectance.average() * t_mean;
    return b;
}

Bsdf make_coated_conductor(const Rgb& conductor_eta, const Rgb& conductor_k, float base_alpha_x, float base_alpha_y,
                           float eta, float alpha_x, float alpha_y) {
    Bsdf b;
    b.kind = BsdfKind::kCoatedConductor;
    const float t_mean = make_coat(&b, eta, alpha_x, alpha_y);
    b.reflectance = conductor_eta / eta;
    b.transmittance = conductor_k / eta;
    const auto blurred = [&](float base_alpha, float alpha) {
        const float wide = std::sqrt(sqr(base_alpha) + 0.5f * sqr((1 - 1 / eta) * alpha));
        return alpha > 0 ? std::max(wide, kSmoothAlpha) : wide;
    };
    const Ggx base = regularised(blurred(base_alpha_x, b.alpha_x), blurred(base_alpha_y, b.alpha_y));
    b.base_alpha_x = base.alpha_x;
    b.base_alpha_y = base.alpha_y;
    // The mean reflectance of the base is Fresnel's at the mean cosine, 2/3.
    const Rgb mean = fresnel_conductor(2.0f / 3, b.reflectance, b.transmittance);
    b.base_weight = mean.average();
    if (base.alpha_x == 0) return b;
    const float alpha = std::sqrt(base.alpha_x * base.alpha_y);
    b.trapped = trapped_table(eta).rows(alpha);
    const float r = clamp(1 - t_mean / (eta * eta), 0.0f, 1.0f);
    const auto scattered = [r](float m) { return m * m * (1 - r) / (1 - m * r); };
    b.trapped_reflectance = {scattered(mean.r), scattered(mean.g), scattered(mean.b)};
    const float integral = cosine_mean_of_product(b.coat_albedo, b.trapped);  // 1 / C
    b.trapped_norm = integral > 0 ? 1 / integral : 0.0f;
    return b;
}

namespace bsdf_families {

BsdfEval eval_coated_diffuse(const Bsdf& b, Vec3 wo, Vec3 wi) {
    if (!to_upper_side(&wo, &wi)) return {};
    const float eo = coat_albedo(b, wo.z), ei = coat_albedo(b, wi.z);
    const float pmf_o = diffuse_coat_pmf(b, eo), pmf_i = diffuse_coat_pmf(b, ei);
    BsdfEval e{b.reflectance * ((1 - eo) * (1 - ei) * kInvPi), (1 - pmf_o) * wi.z * kInvPi, (1 - pmf_i) * wo.z * kInvPi};
    if (b.alpha_x > 0) add_coat_lobe(b, wo, wi, pmf_o, pmf_i, &e);
    return e;
}

bool sample_coated_diffuse(const Bsdf& b, Vec3 wo, float lobe, Vec2 u, BsdfSample* out) {
    if (wo.z == 0) return false;
    const float side = wo.z < 0 ? -1.0f : 1.0f;
    wo.z = std::fabs(wo.z);
    const float albedo = coat_albedo(b, wo.z), pmf = diffuse_coat_pmf(b, albedo);
    Vec3 wi;
    if (lobe >= pmf) {
        wi = sample_cosine_hemisphere(u);
    } else if (b.alpha_x == 0) {
        return finish_delta({-wo.x, -wo.y, side * wo.z}, Rgb(albedo / pmf), pmf, out);
    } else {
        wi = mirrored(wo, Ggx{b.alpha_x, b.alpha_y}.sample_visible_normal(wo, u));
    }
    if (!(wi.z > 0) || !finish(eval_coated_diffuse(b, wo, wi), wi, out)) return false;
    out->wi.z *= side;
    return true;
}

BsdfEval eval_coated_conductor(const Bsdf& b, Vec3 wo, Vec3 wi) {
    if (b.base_alpha_x == 0 || !to_upper_side(&wo, &wi)) return {};
    const ConductorSide o = conductor_side(b, wo.z), i = conductor_side(b, wi.z);
    const float t2 = o.transmitted * i.transmitted;
    BsdfEval e;
    e.f = b.trapped_reflectance * (t2 * o.trapped * i.trapped * b.trapped_norm * kInvPi);
    e.pdf_fwd = (1 - o.coat_pmf - o.base_pmf) * wi.z * kInvPi;
    e.pdf_rev = (1 - i.coat_pmf - i.base_pmf) * wo.z * kInvPi;
    if (b.alpha_x > 0) add_coat_lobe(b, wo, wi, o.coat_pmf, i.coat_pmf, &e);

    const Vec3 inner_o = refracted(wo, b.eta), inner_i = refracted(wi, b.eta);
    if (!(inner_o.z > 0) || !(inner_i.z > 0)) return e;
    const MicrofacetReflection m = microfacet_reflection({b.base_alpha_x, b.base_alpha_y}, inner_o, inner_i);
    const Rgb fresnel = fresnel_conductor(m.cos_h, b.reflectance, b.transmittance);
    const float g = std::min(o.albedo, i.albedo), inv_eta2 = 1 / (b.eta * b.eta);
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
        const float albedo = coat_albedo(b, wo.z), t2 = sqr(1 - albedo);
        const Rgb base = fresnel_conductor(refracted(wo, b.eta).z, b.reflectance, b.transmittance);
        const auto series = [=](float r) { return albedo < 1 ? albedo + t2 * r / (1 - albedo * r) : 1.0f; };
        return finish_delta({-wo.x, -wo.y, side * wo.z}, {series(base.r), series(base.g), series(base.b)}, 1, out);
    }
    const ConductorSide o = conductor_side(b, wo.z);
    Vec3 wi;
    if (lobe < o.coat_pmf) {
        if (b.alpha_x == 0)
            return finish_delta({-wo.x, -wo.y, side * wo.z}, Rgb(o.albedo / o.coat_pmf), o.coat_pmf, out);
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
