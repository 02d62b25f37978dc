#pragma once
// The evaluation of each family of Bsdf, one file each. Contracts are those of Bsdf::eval and Bsdf::sample.

#include "common/scene/bsdf.h"

namespace lightloom::bsdf_families {

BsdfEval eval_conductor(const Bsdf& b, Vec3 wo, Vec3 wi);
bool sample_conductor(const Bsdf& b, Vec3 wo, Vec2 u, BsdfSample* out);

BsdfEval eval_dielectric(const Bsdf& b, const Vec3& wo, const Vec3& wi, TransportMode mode);
bool sample_dielectric(const Bsdf& b, const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out);
bool sample_thin_dielectric(const Bsdf& b, const Vec3& wo, float lobe, BsdfSample* out);

BsdfEval eval_coated_diffuse(const Bsdf& b, Vec3 wo, Vec3 wi);
bool sample_coated_diffuse(const Bsdf& b, Vec3 wo, float lobe, Vec2 u, BsdfSample* out);
BsdfEval eval_coated_conductor(const Bsdf& b, Vec3 wo, Vec3 wi);
bool sample_coated_conductor(const Bsdf& b, Vec3 wo, float lobe, Vec2 u, BsdfSample* out);

/// Moves both directions to the upper side, where two-sided kinds are evaluated. False when they are not on one side.
inline bool to_upper_side(Vec3* wo, Vec3* wi) {
    if (!(wo->z * wi->z > 0)) return false;
    if (wo->z < 0) {
        wo->z = -wo->z;
        wi->z = -wi->z;
    }
    return true;
}

/// The direction of `w`'s mirror image about `m`, both above the surface.
inline Vec3 mirrored(const Vec3& w, const Vec3& m) { return (2 * dot(w, m)) * m - w; }

/// Turns an evaluation into the sample that chose `wi` (the weight is exactly f cos / pdf). False where the density is zero.
inline bool finish(const BsdfEval& e, const Vec3& wi, BsdfSample* out) {
    if (!(e.pdf_fwd > 0)) return false;
    out->wi = wi;
    out->weight = e.f * (std::fabs(wi.z) / e.pdf_fwd);
    out->pdf_fwd = e.pdf_fwd;
    out->pdf_rev = e.pdf_rev;
    out->delta = false;
    return true;
}

inline bool finish_delta(const Vec3& wi, const Rgb& weight, float pmf, BsdfSample* out) {
    out->wi = wi;
    out->weight = weight;
    out->pdf_fwd = out->pdf_rev = pmf;
    out->delta = true;
    return pmf > 0;
}

}  // namespace lightloom::bsdf_families
