#pragma once
// `light`: light tracing [Arvo 1986; Dutre, Lafortune and Willems 1993].
//
// Techniques and effective densities:
//   k = 1  s = 0   rho = A(0)            directly visible emitters, by a camera ray
//   k > 1  s = k   rho = N1 |crop| C(k)  every light vertex is connected to the lens and splatted
// Tables: none. Bias: none, but what the lens sees through a Dirac vertex (mirrors, smooth glass) is missing.

#include "common/path/mis.h"
#include "common/transport/contribution.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct LightSelection {
    struct OnPath : PlainTechniques {
        int s_min() const { return view.k == 1 ? 0 : view.k; }
        double hit() const { return view.k == 1 ? 1 : 0; }
        double next_event() const { return 0; }
        double lens() const { return 1; }
    };
    OnPath on(const PathView& view) const { return {{view}}; }
};

template <class Selection = LightSelection>
struct LightAlgorithm {
    Selection selection;

    float weight(const PathView& view, Technique own) const { return float(mis_weight(view, own, selection.on(view))); }

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        const Scene& scene = context.scene;
        PathVertex *y = context.light_path_vertices, *z = context.camera_path;
        PathView view;
        LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, y, &context.counters);
        contribute_to_lens(scene, light_sampler, y, n, z, &view, &context.counters, contribute);

        // What the camera sees directly: paths of one edge.
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) {
            if (t == 2) contribute_hit<ViewDetail::kFull>(scene, z, t, &view, contribute);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t == 1) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, contribute);
        };
        trace_camera_path(scene, sampler, context.px, context.py, 1, context.roulette, z, &context.counters, visit, escape);
    }
};

}  // namespace lightloom
