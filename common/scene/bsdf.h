#pragma once
// Bsdf: a material resolved at one surface point (all textures looked up). All directions are unit vectors in the local
// shading frame (z = shading normal), pointing away from the surface. `wo` is the direction that a sub-path came from, `wi`
// the one that it continues to; in radiance mode the sub-path started at the camera, in importance mode at a light.
//
// Reciprocity: f(wo, wi) == f(wi, wo) for every kind except transmission through a refracting interface, where
// f_radiance(wo -> wi) = f_importance(wo -> wi) / (eta_wi side / eta_wo side)^2 as usual [Veach 1997, 5.2]; `mode` selects.
// The correction for shading normals is NOT in here (common/path applies it): the surface is the shading frame's.
//
// Interfaces are GGX with height-correlated Smith masking and the visible-normal density, as in pbrt-v4, so that
// pictures agree with it; coats are analytic (bsdf_coated.cpp). Every kind but the dielectrics is two-sided: it looks
// the same from below. Make a Bsdf with one of the functions at the end; only these and the evaluation use its fields.

#include <cstdint>
#include <type_traits>

#include "common/core/inline.h"
#include "common/core/math.h"
#include "common/core/vec.h"
#include "common/scene/sampling.h"

namespace lightloom {

enum class TransportMode : uint8_t { kRadiance, kImportance };

enum class BsdfKind : uint8_t {
    kNull,  ///< Absorbs everything.
    kDiffuse,
    kDiffuseTransmission,
    kConductor,
    kDielectric,
    kThinDielectric,
    kCoatedDiffuse,
    kCoatedConductor,
};

/// Value and both densities of the non-delta lobes, from one evaluation.
struct BsdfEval {
    Rgb f;              ///< BSDF value, 1/sr, without any cosine. Zero where only delta lobes scatter.
    float pdf_fwd = 0;  ///< Density, solid angle, of sample() choosing wi when coming from wo (lobe pmf included).
    float pdf_rev = 0;  ///< Density, solid angle, of sample() choosing wo when coming from wi.
};

struct BsdfSample {
    Vec3 wi;             ///< Local, unit.
    Rgb weight;          ///< f |cos(wi)| / pdf; for a delta lobe its albedo / lobe pmf. Never negative.
    float pdf_fwd = 0;   ///< Solid angle over all non-delta lobes; for a delta lobe the discrete lobe pmf.
    float pdf_rev = 0;   ///< The same for the reversed event.
    bool delta = false;  ///< The lobe chosen is a Dirac distribution: this vertex's event is not connectible.
};

/// A function of |cos| at one roughness: two neighbouring rows of a table (bsdf_tables.h) and the position between
/// them. The rows live as long as the program.
struct TableRows {
    const float* rows = nullptr;
    float fraction = 0;
};

struct Bsdf {
    BsdfKind kind = BsdfKind::kNull;
    bool black = true;                         ///< No light leaves: there is nothing to sample or to connect to.
    float eta = 1;                             ///< Relative index: below the surface (z < 0) over above; a coat's over outside.
    float alpha_x = 0, alpha_y = 0;            ///< GGX alpha of the interface (of the coat for coated kinds); 0 is smooth (delta).
    Rgb reflectance;                           ///< Diffuse albedo; conductor: eta; kCoatedDiffuse: see base_weight.
    Rgb transmittance;                         ///< Diffuse transmission albedo; conductor: k.
    float reflect_pmf = 0;                     ///< kDiffuseTransmission: probability of the reflected lobe.
    float base_alpha_x = 0, base_alpha_y = 0;  ///< kCoatedConductor: the base's alpha, widened by a rough coat.
    TableRows coat_transmission;               ///< Share of light that a rough coat lets down to its base.
    TableRows trapped;                         ///< kCoatedConductor: see bsdf_coated.cpp.
    float thickness = 0;                       ///< Optical thickness of a coat.
    float base_weight = 0;                     ///< Scalar albedo of what is under the coat, for choosing lobes.
    Rgb trapped_reflectance;                   ///< kCoatedConductor: albedo of the internally scattered light ...
    float trapped_norm = 0;                    ///< ... and the normalisation of its lobe.

    /// True if some lobe is not a Dirac delta, so that the vertex can be connected to.
    LL_ALWAYS_INLINE bool has_smooth_lobe() const;
    /// True if some lobe is a Dirac delta.
    bool has_delta_lobe() const;
    /// Whether all light that arrives leaves again, except for what a rough interface loses between its facets.
    bool is_lossless() const { return kind == BsdfKind::kDielectric || kind == BsdfKind::kThinDielectric; }
    /// All values are zero when no non-delta lobe scatters between the directions; none is NaN for finite unit
    /// directions.
    BsdfEval eval(const Vec3& wo, const Vec3& wi, TransportMode mode) const;
    /// `lobe` in [0,1) picks the lobe, `u` in [0,1)^2 the direction. False when the walk ends here (absorbed or degenerate).
    bool sample(const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) const;
    /// Hemispherical-directional albedo estimate for reports and feature layers, in [0,1]; no transport reads it.
    Rgb albedo() const;

  private:
    BsdfEval eval_other(const Vec3& wo, const Vec3& wi, TransportMode mode) const;
    bool sample_other(const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) const;
};
static_assert(std::is_trivially_copyable_v<Bsdf> && sizeof(Bsdf) <= 112);

/// Lambertian reflection on the side of wo. The albedo is clamped per channel to [0, 1], as in pbrt.
Bsdf make_diffuse(const Rgb& reflectance);
/// Lambertian on both sides of a thin sheet; albedos clamped to [0, 1] each.
Bsdf make_diffuse_transmission(const Rgb& reflectance, const Rgb& transmittance);
/// Conductor with complex index eta + i k against what is above it. Alphas are GGX; both below 1e-3 mean a mirror.
Bsdf make_conductor(const Rgb& eta, const Rgb& k, float alpha_x, float alpha_y);
/// The index (eta = 1, k) whose reflectance at normal incidence is `reflectance`, clamped to [0, 0.9999] as in pbrt.
Rgb conductor_k(const Rgb& reflectance);
/// Interface between two dielectrics; eta == 1 lets everything pass as a delta event.
Bsdf make_dielectric(float eta, float alpha_x, float alpha_y);
/// A thin pane: both interfaces with all their inter-reflections, without refraction.
Bsdf make_thin_dielectric(float eta);
/// Dielectric coat of index `eta` and optical thickness `thickness` over a Lambertian base. Light is followed through
/// `base_bounces` reflections at the base; 0 means all of them.
Bsdf make_coated_diffuse(const Rgb& reflectance, float eta, float thickness, float alpha_x, float alpha_y, int base_bounces = 0);
/// Dielectric coat over a conductor whose complex index is given against vacuum.
Bsdf make_coated_conductor(const Rgb& conductor_eta, const Rgb& conductor_k, float base_alpha_x, float base_alpha_y, float eta,
                           float thickness, float alpha_x, float alpha_y);

// The Lambertian case is inline, because in an interior it is most of the work.

inline bool Bsdf::has_smooth_lobe() const {
    switch (kind) {
        case BsdfKind::kDiffuse:
        case BsdfKind::kDiffuseTransmission: return !black;
        case BsdfKind::kConductor:
        case BsdfKind::kDielectric: return alpha_x > 0;
        case BsdfKind::kCoatedDiffuse: return alpha_x > 0 || base_weight > 0;
        case BsdfKind::kCoatedConductor: return base_alpha_x > 0;
        case BsdfKind::kNull:
        case BsdfKind::kThinDielectric: return false;
    }
    return false;
}

inline bool Bsdf::has_delta_lobe() const {
    switch (kind) {
        case BsdfKind::kThinDielectric: return true;
        case BsdfKind::kConductor:
        case BsdfKind::kDielectric:
        case BsdfKind::kCoatedDiffuse:
        case BsdfKind::kCoatedConductor: return alpha_x == 0;
        case BsdfKind::kNull:
        case BsdfKind::kDiffuse:
        case BsdfKind::kDiffuseTransmission: return false;
    }
    return false;
}

/// Bsdf::eval() of the Lambertian kind, which depends only on the cosines of both directions.
inline BsdfEval eval_diffuse(const Rgb& reflectance, float wo_z, float wi_z) {
    if (!(wo_z * wi_z > 0)) return {};
    return {reflectance * kInvPi, std::fabs(wi_z) * kInvPi, std::fabs(wo_z) * kInvPi};
}

inline BsdfEval Bsdf::eval(const Vec3& wo, const Vec3& wi, TransportMode mode) const {
    if (kind != BsdfKind::kDiffuse) return eval_other(wo, wi, mode);
    return eval_diffuse(reflectance, wo.z, wi.z);
}

inline bool Bsdf::sample(const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) const {
    if (kind != BsdfKind::kDiffuse) return sample_other(wo, lobe, u, mode, out);
    if (black || wo.z == 0) return false;
    out->wi = sample_cosine_hemisphere(u);
    out->weight = reflectance;
    out->pdf_fwd = out->wi.z * kInvPi;
    out->pdf_rev = std::fabs(wo.z) * kInvPi;
    out->delta = false;
    if (wo.z < 0) out->wi.z = -out->wi.z;
    return true;
}

}  // namespace lightloom
