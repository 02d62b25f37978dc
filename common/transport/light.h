#pragma once
// `light`: light tracing [Arvo 1986; Dutre, Lafortune and Willems 1993].
//
// Techniques and effective densities:
//   k = 1  s = 0   rho = A(0)            directly visible emitters, by a camera ray
//   k > 1  s = k   rho = N1 |crop| C(k)  every light vertex is connected to the lens and splatted
// Tables: none. Bias: none, but what the lens sees through a Dirac vertex (mirrors, smooth glass) is missing.

#include "common/path/camera_walk.h"
#include "common/path/mis.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct LightSelection {
    static constexpr bool kMerges = false;
    int s_min(int k) const { return k == 1 ? 0 : k; }
    int s_max(int k) const { return k == 1 ? 0 : k; }
    double connect_factor(const PathView&, int) const { return 1; }
};

struct LightAlgorithm {
    Rgb sample(SampleContext& context) const {
        const Scene& scene = context.scene;
        PathVertex* y = context.light_path_vertices;
        LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, y, &context.counters);
        PathView view;
        for (int s = 2; s <= n; ++s) {
            if (!y[s - 1].bsdf.has_smooth_lobe()) continue;
            Vec2 film;
            const Vec3 lens = scene.camera().sample_lens(light_sampler.rng().uniform2());
            const Rgb contribution = connect_to_camera(scene, y, s, lens, &film, &view, &context.counters);
            if (!contribution.is_black())
                context.splat(film, contribution * float(mis_weight(view, {TechniqueKind::kConnect, s}, LightSelection{})));
        }

        Rgb seen;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        PathVertex* z = context.camera_path;
        const auto visit = [&](int t) {
            if (t == 2 && z[1].emitter != kNone) seen = emitter_hit(scene, z, t, &view);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t == 1) seen = environment_hit(scene, z, t, ray, &view);
        };
        trace_camera_path(scene, sampler, context.px, context.py, 1, context.roulette, z, &context.counters, visit, escape);
        return seen;
    }
};

}  // namespace lightloom
