#pragma once
// `path`: unidirectional path tracing with next event estimation [Kajiya 1986; Veach 1997, 9.3].
//
// Techniques and effective densities (PathView's symbols):
//   s = 0  rho = A(0)                                         the camera sub-path hits the emitter
//   s = 1  rho = n next_event A(1)                            x_0 chosen from x_1, n times
// Tables: none. Bias: none. Light that reaches the scene only through Dirac vertices from a light that cannot be hit
// (caustics of point lights) is missing, because no technique here can make such a path.

#include "common/path/mis.h"
#include "common/transport/contribution.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct PathSelection {
    NextEventRays rays;

    struct OnPath : PlainTechniques {
        NextEventRays rays;

        int s_max() const { return 1; }
        double next_event() const { return rays.sigma(view); }
    };
    OnPath on(const PathView& view) const { return {{view}, rays}; }
    NextEventRays next_event_rays() const { return rays; }
};

template <class Selection = PathSelection>
struct PathAlgorithm {
    Selection selection;
    Heuristic heuristic = Heuristic::kBalance;

    float weight(const PathView& view, Technique own) const { return float(mis_weight(view, own, selection.on(view), heuristic)); }

    /// Returns the number of camera vertices.
    template <class Contribute>
    int trace(SampleContext& context, Contribute&& contribute) const {
        return context.roulette.gain ? trace_walk<true>(context, contribute) : trace_walk<false>(context, contribute);
    }

  private:
    template <bool branches, class Contribute>
    int trace_walk(SampleContext& context, Contribute&& contribute) const {
        constexpr ViewDetail kDetail = ViewDetail::kLightEnd;
        const Scene& scene = context.scene;
        const NextEventRays rays = selection.next_event_rays();
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        PathVertex* z = context.camera_path;
        PathView view;
        const auto visit = [&](int t) {
            contribute_hit<kDetail>(scene, z, t, &view, contribute);
            if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<kDetail>(scene, z, t, sampler, rays(t), &view, &context.counters, contribute);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= context.max_edges) contribute_escape<kDetail>(scene, z, t, ray, &view, contribute);
        };
        return trace_camera_path<branches>(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z,
                                           &context.counters, visit, escape);
    }
};

}  // namespace lightloom
