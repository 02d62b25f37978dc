#pragma once
// The contributions that a bidirectional algorithm finds, one connection at a time, before they are weighted: renders
// add them to pixels, training units keep some of them.

#include "common/path/camera_walk.h"
#include "common/path/light_walk.h"
#include "common/path/next_event.h"
#include "common/path/technique.h"

namespace lightloom {

/// One way in which a camera sub-path and a light sub-path met: s light vertices y[0 .. s-1] (s >= 2, and s = 1 where
/// the technique is a connection) and t camera vertices z[0 .. t-1]. x_0 is stored separately because for s <= 1 it
/// need not be on either array.
struct PathContribution {
    Rgb value;                  ///< Unweighted: f over the density of all draws of an iteration together.
    float inverse_density = 1;  ///< C(s) A(s) over that density, without roulette; splats: of one light path.
    Technique technique;
    int t = 0;
    LightSubPath y;
    const PathVertex* z = nullptr;
    Vec3 position, normal;  ///< x_0's; for an infinite light a point outside the scene and the direction of travel.
    uint32_t emitter = 0;
    Vec2 film;           ///< For connections to the lens only.
    float survival = 1;  ///< What roulette has divided `value` by, see SubPathVertex::survival.
};

/// s = 0 on a surface: what z_{t-1} emits towards z_{t-2}, if it lies on an emitter.
template <ViewDetail detail, class Contribute>
LL_ALWAYS_INLINE inline void contribute_hit(const Scene& scene, const PathVertex* z, int t, PathView* view,
                                            Contribute&& contribute) {
    const PathVertex& v = z[t - 1];
    if (v.emitter == kNone) return;
    const Rgb value = emitter_hit<detail>(scene, z, t, view);
    if (value.is_black()) return;
    contribute(PathContribution{.value = value,
                                .technique = Technique::hit(),
                                .t = t,
                                .z = z,
                                .position = v.p,
                                .normal = v.ng,
                                .emitter = uint32_t(v.emitter),
                                .survival = v.survival},
               *view);
}

/// s = 0, environment: what the sky sends along a ray that left the scene from z_{t-1}.
template <ViewDetail detail, class Contribute>
void contribute_escape(const Scene& scene, const PathVertex* z, int t, const WalkRay& ray, PathView* view,
                       Contribute&& contribute) {
    const Rgb value = environment_hit<detail>(scene, z, t, ray, view);
    if (value.is_black()) return;
    const EmitterSet& emitters = scene.emitters();
    contribute(PathContribution{.value = value,
                                .technique = Technique::hit(),
                                .t = t,
                                .z = z,
                                .position = emitters.outside(ray.origin, ray.direction),
                                .normal = -ray.direction,
                                .emitter = uint32_t(emitters.environment_index()),
                                .survival = ray.survival},
               *view);
}

/// s = 1: next event estimation from z_{t-1} with `rays` >= 1 points, evenly spread from numbers of the sampler.
template <ViewDetail detail, class Contribute>
void contribute_next_event(const Scene& scene, const PathVertex* z, int t, CameraSampler& sampler, int rays, PathView* view,
                           WalkCounters* counters, Contribute&& contribute) {
    const PathVertex& v = z[t - 1];
    NextEventSample light;
    const double pick = sampler.rng().uniform_double();
    const Vec2 point = sampler.next_event(t);
    const float share = 1 / float(rays);
    for (int i = 0; i < rays; ++i) {
        if (!scene.emitters().sample_next_event(v.p, evenly_after(pick, i), evenly_after(point, i), &light)) continue;
        const Rgb value = next_event<detail>(scene, z, t, light, view, counters);
        if (value.is_black()) continue;
        contribute(PathContribution{.value = value * share,
                                    .inverse_density = float(view->fwd[0] / view->next_event) * share,
                                    .technique = Technique::next_event(),
                                    .t = t,
                                    .z = z,
                                    .position = light.position,
                                    .normal = light.normal,
                                    .emitter = light.emitter,
                                    .survival = v.survival},
                   *view);
    }
}

/// A light sub-path y[0 .. s-1], s >= 2, that met the camera sub-path z[0 .. t-1] by `technique`.
template <class Vertex>
PathContribution from_light_path(const Rgb& value, Technique technique, const Vertex* y, const PathVertex* z, int t,
                                 Vec2 film = {}) {
    return {.value = value,
            .technique = technique,
            .t = t,
            .y = y,
            .z = z,
            .position = y[0].p,
            .normal = y[0].ng,
            .emitter = uint32_t(y[0].emitter),
            .film = film,
            .survival = y[technique.light_vertices() - 1].survival * z[t - 1].survival};
}

/// Connects every vertex of a light sub-path y[0 .. n-1] that can be connected to the lens.
template <class Contribute>
void contribute_to_lens(const Scene& scene, LightSampler& sampler, const PathVertex* y, int n, PathVertex* z, PathView* view,
                        WalkCounters* counters, Contribute&& contribute) {
    for (int s = 2; s <= n; ++s) {
        if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
        Vec2 film;
        z[0].p = scene.camera().sample_lens(sampler.rng().uniform2());
        const Rgb value = connect_to_camera(scene, y, s, &z[0].p, &film, view, counters);
        if (!value.is_black()) contribute(from_light_path(value, Technique::lens(s), y, z, 1, film), *view);
    }
}

}  // namespace lightloom
