#pragma once
// `bdpt`: bidirectional path tracing with classic pairing [Veach 1997, chapter 10; Lafortune and Willems 1993].
//
// Every camera sample owns one light sub-path; all their vertices are connected. Effective densities:
//   s = 0          rho = A(0)
//   s = 1          rho = n next_event A(1)      x_0 chosen afresh from x_1, n times; for point lights at the first hit
//                                               trusted by its variance (common/path/next_event.h)
//   2 <= s <= k-1  rho = C(s) A(s)
//   s = k          rho = N1 |crop| C(k)         N1 = 1 light path per pixel and iteration; |crop| rendered pixels, because
//                                               A(.) is a density per pixel while a light path may land in any of them
// k = 1 (directly visible emitters) is s = 0 alone. Tables: none. Bias: none. Paths of the form light - specular -
// diffuse - specular - camera (SDS) with lights that cannot be hit are missing, as in every method without merging.

#include "common/path/corrected.h"
#include "common/transport/contribution.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct BdptSelection {
    double light_paths_per_iteration = 1;  ///< N1 |crop|
    NextEventRays rays;

    struct OnPath : PlainTechniques {
        double light_paths_per_iteration;
        NextEventRays rays;

        double next_event() const { return rays.sigma(view); }

        double shadow_rays() const { return rays(view.k); }
        double connections(int) const { return 1; }
        double connect(int s) const { return s == 1 ? 0 : 1; }
        double connect(int s, double share) const { return connect(s) * share; }
        double lens() const { return light_paths_per_iteration; }
    };
    OnPath on(const PathView& view) const { return {{view}, light_paths_per_iteration, rays}; }
    NextEventRays next_event_rays() const { return rays; }
};

/// Traces one camera sample and one light sub-path and calls contribute(contribution, view) for each of their
/// contributions. light_done(y, n) is called once the light sub-path is complete. Returns the number of
/// camera vertices. The light sub-path follows the context's rule of roulette.
template <ViewDetail detail, bool branches = false, class LightDone, class Contribute>
int trace_bdpt_sample(SampleContext& context, const RouletteRule& camera_roulette, NextEventRays rays, LightDone&& light_done,
                      Contribute&& contribute) {
    const Scene& scene = context.scene;
    PathVertex *y = context.light_path_vertices, *z = context.camera_path;
    PathView view;
    LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
    const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, y, &context.counters);
    light_done(y, n);
    contribute_to_lens(scene, light_sampler, y, n, z, &view, &context.counters, contribute);

    CameraSampler sampler(context.seed, context.iteration, context.pixel);
    const auto visit = [&](int t) {
        contribute_hit<detail>(scene, z, t, &view, contribute);
        if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
        contribute_next_event<detail>(scene, z, t, sampler, rays(t), &view, &context.counters, contribute);
        for (int s = 2; s <= n && s + t - 1 <= context.max_edges; ++s) {
            if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
            if (const Rgb c = connect<detail>(scene, y, s, z, t, &view, &context.counters); !c.is_black())
                contribute(from_light_path(c, Technique::connect(s), y, z, t), view);
        }
    };
    const auto escape = [&](int t, const WalkRay& ray) {
        if (t <= context.max_edges) contribute_escape<detail>(scene, z, t, ray, &view, contribute);
    };
    return trace_camera_path<branches>(scene, sampler, context.px, context.py, context.max_edges, camera_roulette, z,
                                       &context.counters, visit, escape);
}

template <class Selection = BdptSelection>
struct BdptAlgorithm {
    Selection selection;
    Heuristic heuristic = Heuristic::kBalance;

    float weight(const PathView& view, Technique own) const { return float(mis_weight(view, own, selection.on(view), heuristic)); }

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        const auto light_done = [](const PathVertex*, int) {};
        const NextEventRays rays = selection.next_event_rays();
        const auto run = [&](auto&& found) {
            if (context.roulette.gain)
                trace_bdpt_sample<ViewDetail::kFull, true>(context, context.roulette, rays, light_done, found);
            else
                trace_bdpt_sample<ViewDetail::kFull, false>(context, context.roulette, rays, light_done, found);
        };
        if constexpr (kReadsFootprint<Selection>)
            run([&](const PathContribution& c, PathView& view) {
                view_footprint(context.scene.emitters()[c.emitter], c.y, c.technique.light_vertices(), c.z, c.t, &view);
                contribute(c, view);
            });
        else
            run(contribute);
    }
};

}  // namespace lightloom
