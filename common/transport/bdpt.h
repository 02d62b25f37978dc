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

struct BdptAlgorithm {
    BdptSelection selection;
    Heuristic heuristic = Heuristic::kBalance;

    Rgb sample(SampleContext& context) const {
        const Scene& scene = context.scene;
        PathVertex *y = context.light_path_vertices, *z = context.camera_path;
        PathView view;
        const auto weighted = [&](const Rgb& contribution, int s) {
            return contribution * float(mis_weight(view, {TechniqueKind::kConnect, s}, selection, heuristic));
        };
        Rng rng({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(scene, rng, context.max_edges, context.roulette, y, &context.counters);
        for (int s = 2; s <= n; ++s) {
            if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
            Vec2 film;
            const Vec3 lens = scene.camera().sample_lens(rng.uniform2());
            const Rgb c = connect_to_camera(scene, y, s, lens, &film, &view, &context.counters);
            if (!c.is_black()) context.splat(film, weighted(c, s));
        }

        Rgb sum;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) {
            const PathVertex& v = z[t - 1];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit(scene, z, t, &view); !c.is_black()) sum += weighted(c, 0);
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            NextEventSample light;
            const double pick = sampler.rng().uniform_double();
            if (scene.emitters().sample_next_event(v.p, pick, sampler.next_event(t), &light))
                if (const Rgb c = next_event(scene, z, t, light, &view, &context.counters); !c.is_black()) sum += weighted(c, 1);
            for (int s = 2; s <= n && s + t - 1 <= context.max_edges; ++s) {
                if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
                if (const Rgb c = connect(scene, y, s, z, t, &view, &context.counters); !c.is_black()) sum += weighted(c, s);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            if (const Rgb c = environment_hit(scene, z, t, ray, &view); !c.is_black()) sum += weighted(c, 0);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters,
                          visit, escape);
        return sum;
    }
};

}  // namespace lightloom
