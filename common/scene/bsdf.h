#pragma once
// Bsdf: a material resolved at one surface point (all textures looked up). All directions are unit vectors in the local
// shading frame (z = shading normal), pointing away from the surface. `wo` is the direction that a sub-path came from, `wi`
// the one that it continues to; in radiance mode the sub-path started at the camera, in importance mode at a light.
//
// Reciprocity: f(wo, wi) == f(wi, wo) for every kind except transmission through a refracting interface, where
// f_radiance(wo -> wi) = f_importance(wo -> wi) * (eta_wi side / eta_wo side)^-2 as usual [Veach 1997, 5.2]; `mode` selects.
// The correction for shading normals is NOT in here (common/path applies it): the surface is the shading frame's.

#include <cstdint>
#include <type_traits>

#include "common/core/vec.h"

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
    Vec3 wi;              ///< Local, unit.
    Rgb weight;           ///< f |cos(wi)| / pdf; for a delta lobe its albedo / lobe pmf. Never negative.
    float pdf_fwd = 0;    ///< Solid angle over all non-delta lobes; for a delta lobe the discrete lobe pmf.
    float pdf_rev = 0;    ///< The same for the reversed event.
    bool delta = false;   ///< The lobe chosen is a Dirac distribution: this vertex's event is not connectible.
};

struct Bsdf {
    BsdfKind kind = BsdfKind::kNull;
    bool two_lobes_delta = false;  ///< Free for the kind's own use.
    float eta = 1;                 ///< Relative index: below the surface (z < 0) over above.
    float alpha_x = 0, alpha_y = 0;            ///< GGX alpha of the interface; 0 means smooth (delta).
    float base_alpha_x = 0, base_alpha_y = 0;  ///< kCoatedConductor's base.
    Rgb reflectance;               ///< Albedo, F0, or conductor eta, by kind.
    Rgb transmittance;             ///< Diffuse transmission albedo, or conductor k, by kind.
    float table[4] = {0, 0, 0, 0}; ///< Per-point constants that a kind precomputes (for example T_avg of a coat).

    /// True if some lobe is not a Dirac delta, so that the vertex can be connected to.
    bool has_smooth_lobe() const;
    /// True if some lobe is a Dirac delta.
    bool has_delta_lobe() const;
    /// All zero when both directions are such that no non-delta lobe scatters; never NaN for finite unit directions.
    BsdfEval eval(const Vec3& wo, const Vec3& wi, TransportMode mode) const;
    /// `lobe` in [0,1) picks the lobe, `u` in [0,1)^2 the direction. False when the walk ends here (absorbed or degenerate).
    bool sample(const Vec3& wo, float lobe, Vec2 u, TransportMode mode, BsdfSample* out) const;
    /// Hemispherical-directional albedo estimate for reports and feature layers, in [0,1]; no transport reads it.
    Rgb albedo() const;
};
static_assert(std::is_trivially_copyable_v<Bsdf>);

}  // namespace lightloom
