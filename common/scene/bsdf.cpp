#include "common/scene/bsdf.h"

#include <algorithm>

#include "common/scene/bsdf_families.h"
#include "common/scene/bsdf_fresnel.h"

namespace lightloom {
namespace {

float unit(float v) { return clamp(v, 0.0f, 1.0f); }
Rgb unit(const Rgb& c) { return {unit(c.r), unit(c.g), unit(c.b)}; }

BsdfEval eval_diffuse_transmission(const Bsdf& b, const Vec3& wo, const Vec3& wi) {
    const float zo = std::fabs(wo.z), zi = std::fabs(wi.z);
    if (zo == 0 || zi == 0) return {};
    const bool reflect = (wo.z > 0) == (wi.z > 0);
    const float pmf = reflect ? b.reflect_pmf : 1 - b.reflect_pmf;
    return {(reflect ? b.reflectance : b.transmittance) * kInvPi, pmf * zi * kInvPi, pmf * zo * kInvPi};
}

bool sample_diffuse_transmission(const Bsdf& b, const Vec3& wo, float lobe, Vec2 u, BsdfSample* out) {
    if (b.black || wo.z == 0) return false;
    Vec3 wi = sample_cosine_hemisphere(u);
    const bool reflect = lobe < b.reflect_pmf;
    if (reflect != (wo.z > 0)) wi.z = -wi.z;
    return bsdf_families::finish(eval_diffuse_transmission(b, wo, wi), wi, out);
}

}  // namespace

Bsdf make_diffuse(const Rgb& reflectance) {
    Bsdf b;
    b.kind = BsdfKind::kDiffuse;
    b.reflectance = unit(reflectance);
    b.black = b.reflectance.is_black();
    return b;
}

Bsdf make_diffuse_transmission(const Rgb& reflectance, const Rgb& transmittance) {
    Bsdf b;
    b.kind = BsdfKind::kDiffuseTransmission;
    b.reflectance = unit(reflectance);
    b.transmittance = unit(transmittance);
    const float r = b.reflectance.max_component(), t = b.transmittance.max_component();
    b.black = r + t == 0;
    b.reflect_pmf = b.black ? 0.0f : r / (r + t);
    return b;
}

BsdfEval Bsdf::eval_other(const Vec3& wo, const Vec3& wi, TransportMode mode) const {
    switch (kind) {
        case BsdfKind::kDiffuseTransmission: return eval_diffuse_transmission(*this, wo, wi);
        case BsdfKind::kConductor: return bsdf_families::eval_conductor(*this, wo, wi);
        case BsdfKind::kDielectric: return bsdf_families::eval_dielectric(*this, wo, wi, mode);
        case BsdfKind::kCoatedDiffuse: return bsdf_families::eval_coated_diffuse(*this, wo, wi);
        case BsdfKind::kCoatedConductor: return bsdf_families::eval_coated_conductor(*this, wo, wi);
        case BsdfKind::kNull:
        case BsdfKind::kDiffuse:  // inline in the header
        case BsdfKind::kThinDielectric: break;
    }
    return {};
}

bool Bsdf::sample_other(const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) const {
    switch (kind) {
        case BsdfKind::kDiffuseTransmission: return sample_diffuse_transmission(*this, wo, lobe, u, out);
        case BsdfKind::kConductor: return bsdf_families::sample_conductor(*this, wo, u, out);
        case BsdfKind::kDielectric: return bsdf_families::sample_dielectric(*this, wo, lobe, u, mode, out);
        case BsdfKind::kThinDielectric: return bsdf_families::sample_thin_dielectric(*this, wo, lobe, out);
        case BsdfKind::kCoatedDiffuse: return bsdf_families::sample_coated_diffuse(*this, wo, lobe, u, out);
        case BsdfKind::kCoatedConductor: return bsdf_families::sample_coated_conductor(*this, wo, lobe, u, out);
        case BsdfKind::kNull:
        case BsdfKind::kDiffuse: break;
    }
    return false;
}

Rgb Bsdf::albedo() const {
    // The coat's reflectance at normal incidence stands for all directions, because feature layers mostly show surfaces
    // from the front.
    const float coat = fresnel_dielectric(1, eta).reflectance;
    switch (kind) {
        case BsdfKind::kNull: return Rgb(0);
        case BsdfKind::kDiffuse: return reflectance;
        case BsdfKind::kDiffuseTransmission: return unit(reflectance + transmittance);
        case BsdfKind::kConductor: return fresnel_conductor(1, reflectance, transmittance);
        case BsdfKind::kDielectric:
        case BsdfKind::kThinDielectric: return Rgb(1);
        case BsdfKind::kCoatedDiffuse: {
            // The base's lobe carries A(wo) reflectance times the cosine mean of A, for which A stands in.
            const float transmitted = 1 - coat;
            return unit(Rgb(coat) + reflectance * (transmitted * transmitted));
        }
        case BsdfKind::kCoatedConductor: {
            const Rgb base = fresnel_conductor(1, reflectance, transmittance);
            const auto series = [coat](float r) { return coat + (1 - coat) * (1 - coat) * r / (1 - coat * r); };
            return {series(base.r), series(base.g), series(base.b)};
        }
    }
    return Rgb(0);
}

}  // namespace lightloom
