#pragma once
// `bdpt`: bidirectional path tracing with classic pairing [Veach 1997, chapter 10; Lafortune and Willems 1993].
//
// Every camera sample owns one light sub-path; all their vertices are connected. Effective densities:
//   s = 0          rho = A(0)
//   s = 1          rho = next_event A(1)        x_0 chosen afresh from x_1
//   2 <= s <= k-1  rho = C(s) A(s)
//   s = k          rho = N1 |crop| C(k)         N1 = 1 light path per pixel and iteration; |crop| rendered pixels, because
//                                               A(.) is a density per pixel while a light path may land in any of them
// k = 1 (directly visible emitters) is s = 0 alone. Tables: none. Bias: none. Paths of the form light - specular -
// diffuse - specular - camera (SDS) with lights that cannot be hit are missing, as in every method without merging.

#include "common/path/camera_walk.h"
#include "common/path/mis.h"
#include "common/transport/contribution.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct BdptSelection {
    static constexpr bool kMerges = false;
    double light_paths_per_iteration = 1;  ///< N1 |crop|

    int s_min(int) const { return 0; }
    int s_max(int k) const { return k == 1 ? 0 : k; }
    double connect_factor(const PathView& view, int s) const {
        if (s == view.k) return light_paths_per_iteration;
        return s == 1 ? view.next_event / view.fwd[0] : 1;
    }
};

/// Traces one camera sample and one light sub-path and calls contribute(contribution, view) for everything that they give.
/// light_done(y, n) is called once the light sub-path is complete.
template <ViewDetail detail, class LightDone, class Contribute>
void trace_bdpt_sample(SampleContext& context, LightDone&& light_done, Contribute&& contribute) {
    const Scene& scene = context.scene;
    PathVertex *y = context.light_path_vertices, *z = context.camera_path;
    PathView view;
    LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
    const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, y, &context.counters);
    light_done(y, n);
    const auto from_light = [&](const Rgb& value, int s, int t, Vec2 film) {
        contribute(PathContribution{value, 1, s, t, y, z, y[0].p, y[0].ng, uint32_t(y[0].emitter), film,
                                    y[s - 1].survival * z[t - 1].survival},
                   view);
    };
    for (int s = 2; s <= n; ++s) {
        if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
        Vec2 film;
        z[0].p = scene.camera().sample_lens(light_sampler.rng().uniform2());
        const Rgb c = connect_to_camera(scene, y, s, z[0].p, &film, &view, &context.counters);
        if (!c.is_black()) from_light(c, s, 1, film);
    }

    CameraSampler sampler(context.seed, context.iteration, context.pixel);
    const auto visit = [&](int t) {
        const PathVertex& v = z[t - 1];
        if (v.emitter != kNone)
            if (const Rgb c = emitter_hit<detail>(scene, z, t, &view); !c.is_black())
                contribute(PathContribution{c, 1, 0, t, y, z, v.p, v.ng, uint32_t(v.emitter), {}, v.survival}, view);
        if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
        NextEventSample light;
        const double pick = sampler.rng().uniform_double();
        if (scene.emitters().sample_next_event(v.p, pick, sampler.next_event(t), &light))
            if (const Rgb c = next_event<detail>(scene, z, t, light, &view, &context.counters); !c.is_black())
                contribute(PathContribution{c,
                                            float(view.fwd[0] / view.next_event),
                                            1,
                                            t,
                                            y,
                                            z,
                                            light.position,
                                            light.normal,
                                            light.emitter,
                                            {},
                                            v.survival},
                           view);
        for (int s = 2; s <= n && s + t - 1 <= context.max_edges; ++s) {
            if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
            if (const Rgb c = connect<detail>(scene, y, s, z, t, &view, &context.counters); !c.is_black()) from_light(c, s, t, {});
        }
    };
    const auto escape = [&](int t, const WalkRay& ray) {
        if (t > context.max_edges) return;
        const Rgb c = environment_hit<detail>(scene, z, t, ray, &view);
        if (c.is_black()) return;
        const EmitterSet& emitters = scene.emitters();
        contribute(PathContribution{c,
                                    1,
                                    0,
                                    t,
                                    y,
                                    z,
                                    emitters.outside(ray.origin, ray.direction),
                                    -ray.direction,
                                    uint32_t(emitters.environment_index()),
                                    {},
                                    ray.survival},
                   view);
    };
    trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters, visit,
                      escape);
}

/// A selection with fewer techniques than BdptSelection (connect_factor 0) makes an algorithm of the techniques that remain.
template <class Selection = BdptSelection>
struct BdptAlgorithm {
    Selection selection;
    Heuristic heuristic = Heuristic::kBalance;

    Rgb sample(SampleContext& context) const {
        Rgb sum;
        trace_bdpt_sample<ViewDetail::kFull>(
            context, [](const PathVertex*, int) {},
            [&](const PathContribution& c, const PathView& view) {
                const Rgb weighted = c.value * float(mis_weight(view, {TechniqueKind::kConnect, c.s}, selection, heuristic));
                if (c.to_lens())
                    context.splat(c.film, weighted);
                else
                    sum += weighted;
            });
        return sum;
    }
};

}  // namespace lightloom
