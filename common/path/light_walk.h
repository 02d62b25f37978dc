#pragma once
// The light sub-path: where its random numbers come from, and the walk from the light.

#include "common/path/walk_sampler.h"

namespace lightloom {

/// Random numbers of one light sub-path, keyed by (seed, stage, iteration, path). The light, the emission and the first
/// scattering come from low-discrepancy sequences over the paths of an iteration or group; the rest is independent.
class LightSampler : public WalkSampler {
  public:
    /// `key.index` is the number of the path; numbers that differ above 32 bits belong to different sequences.
    LL_ALWAYS_INLINE explicit LightSampler(const RngKey& key)
        : WalkSampler(key,
                      Rng({key.seed, Stage::kLightScramble, key.iteration, uint64_t(key.stage) << 56 | key.index >> 32}).next_u64(),
                      uint32_t(key.index), 3) {}

    /// A number in [0, 1) that selects the light. A point of the sequence has 24 bits, too few to tell a million lights
    /// apart.
    double pick() { return double(point(0).x) + rng().uniform_double() * 0x1p-24; }
    Vec2 position() { return point(1); }
    Vec2 direction() { return point(2); }
};

/// Starts a light sub-path: sets y_0 and the ray that leaves it. False when the place of y_0 is black. y_0's alpha is F(1) /
/// C(1), its emission without the direction. The ray is black if nothing leaves y_0 in its direction; y_0 counts all the
/// same, because its density is that of its place alone.
inline bool start_light_path(const Scene& scene, LightSampler& sampler, PathVertex* y0, WalkRay* ray) {
    EmissionSample s;
    if (!scene.emitters().sample_emission(sampler.pick(), sampler.position(), sampler.direction(), &s)) return false;
    const Emitter& e = scene.emitters()[s.emitter];
    y0->p = s.position;
    y0->ng = s.normal;
    y0->emitter = int32_t(s.emitter);
    y0->alpha = scene.emitters().strength(e, s.position, s.direction) / s.pdf_position;
    y0->survival = 1;
    y0->label = y0->reverse_label = kNoLabel;
    y0->reverse_branch = 0;
    y0->fwd = s.pdf_position;
    y0->rev = 0;
    y0->delta = y0->lossless = false;
    ray->direction = s.direction;
    ray->alpha = s.alpha;
    ray->pdf = s.pdf_direction;
    ray->from_infinite = e.is_infinite();
    ray->clearance = e.clearance;
    ray->previous_hittable = e.can_be_hit();
    ray->origin = e.is_area() ? offset_origin(s.position, s.normal, s.direction, e.reach) : s.position;
    return !y0->alpha.is_black();
}

/// Traces a light sub-path into `path` (room for `max_vertices`); returns the number of vertices, y_0 included. Vertices
/// whose own event was a Dirac lobe are kept (marked) because later vertices need them.
inline int trace_light_path(const Scene& scene, LightSampler& sampler, int max_vertices, const RouletteRule& rule, PathVertex* path,
                            WalkCounters* counters) {
    WalkRay ray;
    if (max_vertices < 1 || !start_light_path(scene, sampler, &path[0], &ray)) return 0;
    if (ray.alpha.is_black()) return 1;
    const bool area = scene.emitters()[uint32_t(path[0].emitter)].is_area();
    const float start = scalar_of(ray.alpha);
    int n = 1;
    while (n < max_vertices) {
        SurfacePoint point;
        ++counters->rays;
        if (!scene.intersect(ray.origin, ray.direction, &point, ray.clearance)) break;
        PathVertex& v = path[n];
        arrive<TransportMode::kImportance>(ray, path[n - 1].p, path[n - 1].ng, n > 1 || area, point, &v);
        if (!(v.fwd > 0) || !std::isfinite(v.fwd) || !std::isfinite(v.adjoint)) break;
        v.set_bsdf(scene.bsdf_at(point));
        ++counters->vertices;
        ++n;
        if (n >= max_vertices) break;
        if (!leave<TransportMode::kImportance>(&v, &path[n - 2], sampler.scattering(n), &ray)) break;
        if (!survive(rule, n, start, sampler.roulette(), &ray)) break;
    }
    return n;
}

}  // namespace lightloom
