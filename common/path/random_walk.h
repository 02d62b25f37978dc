#pragma once
// The random walk of both sub-paths.
//
// Russian roulette divides the throughput by the true survival probability, or by the expected number of branches, and
// stays out of every density: the weights are a function of the path alone, and roulette treats a sub-path alike whichever
// technique will use it. survival.h is what weights may know of roulette.

#include "common/core/rng.h"
#include "common/path/path_view.h"
#include "common/path/vertex.h"
#include "common/tables/gain_table.h"

namespace lightloom {

struct RouletteRule {
    int first_vertex = 4;  ///< Sub-path vertices with a smaller index always go on.
    float min_survival = 0.5f;
    /// Camera sub-paths go by this instead, from their first vertex in the scene on, and may divide; null: they do not.
    const GainTable* gain = nullptr;
};

/// Uniforms that one scattering event consumes.
struct ScatterSample {
    float lobe;
    Vec2 direction;
};

/// State of a walk between two vertices.
struct WalkRay {
    Vec3 origin, direction;
    Rgb alpha;                      ///< Throughput carried along the ray.
    double pdf = 0;                 ///< Density of the direction, solid angle; of parallel rays: area across them.
    bool from_infinite = false;     ///< Leaves an infinite light (area on its disc) or a camera with parallel rays.
    float clearance = 0;            ///< At the origin; see Scene::intersect().
    bool previous_hittable = true;  ///< False leaving a light that cannot be hit: its reverse density is zero.
    float survival = 1;             ///< See SubPathVertex.
    /// Product of the squared index ratios that refraction has divided a camera sub-path's radiance by: alpha * index_ratio2 is
    /// what is left of the light's power, which lossless glass keeps.
    float index_ratio2 = 1;
};

struct WalkCounters {
    uint64_t rays = 0, vertices = 0, connections = 0;
};

/// Fills in geometry of the next vertex `v` reached by `ray` from `previous`; everything but the material.
template <TransportMode mode>
void arrive(const WalkRay& ray, const Vec3& previous_p, const Vec3& previous_ng, bool previous_on_surface,
            const SurfacePoint& point, PathVertex* v) {
    v->p = point.p;
    v->ng = point.ng;
    v->shading = point.shading;
    v->wo = -ray.direction;
    v->wo_local = point.shading.to_local(v->wo);
    v->alpha = ray.alpha;
    v->emitter = point.emitter;
    v->reach = point.reach;
    v->delta = v->lossless = false;
    v->rev = 0;
    v->survival = ray.survival;
    v->label = v->reverse_label = kNoLabel;
    v->reverse_branch = 0;
    const float cosine = abs_dot(v->ng, v->wo);
    if (ray.from_infinite) {
        v->fwd = ray.pdf * cosine;
        v->to_previous = ray.previous_hittable ? 1.0f : 0.0f;
    } else {
        const float inv_d2 = 1 / length_squared(point.p - previous_p);
        v->fwd = ray.pdf * (cosine * inv_d2);
        v->to_previous = !ray.previous_hittable ? 0 : previous_on_surface ? abs_dot(previous_ng, v->wo) * inv_d2 : inv_d2;
    }
    v->adjoint = mode == TransportMode::kImportance ? std::fabs(v->wo_local.z) / cosine : 1.0f;
}

/// Squared ratio of the index on the far side over that on wo's, where `v` refracts into the local direction `wi`; 1 otherwise.
inline float index_ratio2(const PathVertex& v, const Vec3& wi) {
    if (v.bsdf.kind != BsdfKind::kDielectric || !(wi.z * v.wo_local.z < 0)) return 1;
    return v.wo_local.z > 0 ? v.bsdf.eta * v.bsdf.eta : 1 / (v.bsdf.eta * v.bsdf.eta);
}

/// PathVertex::step of a camera vertex that scattered towards the light by `s`: F gains f |l.ns| / |l.ng| |c.ng| (light side l,
/// camera side c), C gains the density of c from l. The common factor |cos| / d^2 of F's G and C's area density is left out of
/// both. A Dirac lobe gives up its squared index ratio, which is the camera's alone [Veach 1997, 5.2].
inline Rgb light_step(const PathVertex& v, const BsdfSample& s, const Vec3& to_light) {
    float factor = s.pdf_fwd * abs_dot(v.ng, v.wo) / (abs_dot(v.ng, to_light) * s.pdf_rev);
    if (s.delta) {
        factor *= std::fabs(s.wi.z / v.wo_local.z) * index_ratio2(v, s.wi);
    }
    // Without a density from the light no light prefix crosses this vertex, and the caller finds C = 0 first.
    return std::isfinite(factor) ? s.weight * factor : Rgb{};
}

/// Lets `v` scatter: chooses the next ray, sets v->delta and the predecessor's reverse density. False when the walk ends.
template <TransportMode mode>
bool leave(PathVertex* v, PathVertex* previous, const ScatterSample& u, WalkRay* ray) {
    BsdfSample s;
    if (!v->bsdf.sample(v->wo_local, u.lobe, u.direction, mode, &s)) return false;
    if (!(s.pdf_fwd > 0)) return false;  // exactly grazing, but weights divide by this density
    ray->direction = v->shading.to_world(s.wi);
    Rgb weight = s.weight;
    if constexpr (mode == TransportMode::kImportance) {
        const float shading_cosine = std::fabs(s.wi.z);
        if (!(shading_cosine > 0)) return false;
        weight *= v->adjoint * (abs_dot(ray->direction, v->ng) / shading_cosine);  // [Veach 1997, eq. 5.19]
    } else {
        v->step = light_step(*v, s, ray->direction);
        ray->index_ratio2 *= index_ratio2(*v, s.wi);
    }
    ray->alpha = v->alpha * weight;
    if (ray->alpha.is_black()) return false;
    v->delta = s.delta;
    previous->rev = double(s.pdf_rev) * v->to_previous;
    ray->pdf = s.pdf_fwd;
    ray->origin = offset_origin(v->p, v->ng, ray->direction, v->reach);
    ray->clearance = 0;
    ray->from_infinite = false;
    ray->previous_hittable = true;
    return true;
}

/// False when roulette ends the walk; otherwise the throughput is divided by the survival probability. This is the
/// share of its power that the sub-path has kept since it began with the throughput `start`, but at least
/// rule.min_survival; a sub-path that has lost nothing always goes on.
inline bool survive(const RouletteRule& rule, int vertex_index, float start, float u, WalkRay* ray) {
    if (vertex_index < rule.first_vertex) return true;
    const float q = clamp(scalar_of(ray->alpha) * ray->index_ratio2 / start, rule.min_survival, 1.0f);
    constexpr float kLossless = 1 - 1e-5f;  // what rounding leaves of 1 after a hundred lossless events
    if (q > kLossless) return true;
    if (u >= q) return false;
    ray->alpha *= 1 / q;
    ray->survival *= q;
    return true;
}

}  // namespace lightloom
