#pragma once
// `path`: unidirectional path tracing with next event estimation [Kajiya 1986; Veach 1997, 9.3].
//
// Techniques and effective densities (PathView's symbols):
//   s = 0  rho = A(0)                                         the camera sub-path hits the emitter
//   s = 1  rho = next_event A(1)                              x_0 chosen from x_1
// Tables: none. Bias: none. Light that reaches the scene only through Dirac vertices from a light that cannot be hit
// (caustics of point lights) is missing, because no technique here can make such a path.

#include "common/path/camera_walk.h"
#include "common/path/mis.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct PathSelection {
    static constexpr bool kMerges = false;
    int s_min(int) const { return 0; }
    int s_max(int k) const { return k >= 2 ? 1 : 0; }  // directly visible emitters are hits alone
    double connect_factor(const PathView& view, int s) const { return s == 0 ? 1 : view.next_event / view.fwd[0]; }
};

struct PathAlgorithm {
    Heuristic heuristic = Heuristic::kBalance;

    Rgb sample(SampleContext& context) const {
        constexpr ViewDetail kDetail = ViewDetail::kLightEnd;
        const PathSelection selection;
        const Scene& scene = context.scene;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        PathVertex* z = context.camera_path;
        PathView view;
        Rgb sum;
        const auto add = [&](const Rgb& contribution, int s) {
            if (!contribution.is_black())
                sum += contribution * float(mis_weight(view, {TechniqueKind::kConnect, s}, selection, heuristic));
        };
        const auto visit = [&](int t) {
            const PathVertex& v = z[t - 1];
            if (v.emitter != kNone) add(emitter_hit<kDetail>(scene, z, t, &view), 0);
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            NextEventSample light;
            const double pick = sampler.rng().uniform_double();
            if (scene.emitters().sample_next_event(v.p, pick, sampler.next_event(t), &light))
                add(next_event<kDetail>(scene, z, t, light, &view, &context.counters), 1);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= context.max_edges) add(environment_hit<kDetail>(scene, z, t, ray, &view), 0);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters, visit,
                          escape);
        return sum;
    }
};

}  // namespace lightloom
