#pragma once
// `lvcbpt`: bidirectional path tracing with a light-vertex cache and uniform selection [Davidovic, Krivanek, Hasan and Slusallek
// 2014, section 4.1; the baseline of Su, Li and Wang 2022].
//
// Every camera vertex is connected to N prefixes drawn uniformly from the unit's cache (V prefixes of M paths). Densities:
//   s = 0          rho = A(0)
//   1 <= s <= k-1  rho = N / v  C(s) A(s)       v: expected number of prefixes per light path, a table. The estimator divides by
//                                               what was really done, V / (M N): the weight must not know the realised V
//   s = k          rho = N1 |crop| C(k)
// Tables: v (vertices_per_path). Bias: none. Missing: what `bdpt` misses.

#include <memory>

#include "common/path/mis.h"
#include "common/tables/subspace_tables.h"
#include "common/transport/light_cache.h"

namespace lightloom {

struct UniformSelection {
    static constexpr bool kMerges = false;
    double light_paths_per_iteration = 1;  ///< N1 |crop|
    double connection_density = 1;         ///< N / v

    int s_min(int) const { return 0; }
    int s_max(int k) const { return k == 1 ? 0 : k; }
    double connect_factor(const PathView& view, int s) const {
        return s == 0 ? 1 : s == view.k ? light_paths_per_iteration : connection_density;
    }
};

/// A selection with fewer techniques (connect_factor 0) makes an algorithm of those that remain.
template <class Selection = UniformSelection>
struct LvcbptAlgorithm {
    Selection selection;
    Heuristic heuristic = Heuristic::kBalance;
    int connections = 3;         ///< N
    uint64_t minimum_paths = 1;  ///< Of a unit's cache.

    struct State {
        LightCache cache;
        std::vector<LightCandidate> candidates;
    };

    float weight(const PathView& view, int s) const {
        return float(mis_weight(view, {TechniqueKind::kConnect, s}, selection, heuristic));
    }

    State prepare(const UnitScope& scope, UnitPreparation* preparation) const {
        State state;
        const uint64_t paths = std::max(minimum_paths, scope.work.light_path_count);
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, auto& chunk) {
            PathView view;
            Vec2 film;
            const Vec3 lens = scope.scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scope.scene, y, s, lens, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            const uint32_t pixel = uint32_t(scope.scene.frame().crop.index(int(film.x), int(film.y)));
            chunk.splats.push_back({pixel, scope.work.first_iteration, c * weight(view, s)});
        };
        state.cache = trace_light_cache(scope, paths, preparation, [](PathVertex*, int) {}, splat);
        if (scope.stop.stop_requested()) return state;
        for (uint64_t m = 0; m < state.cache.path_count(); ++m) {
            for_each_candidate(state.cache, m, scope.max_edges,
                               [&](const LightCandidate& c, const PathVertex&) { state.candidates.push_back(c); });
        }
        return state;
    }

    Rgb sample(SampleContext& context, const State& state) const {
        const Scene& scene = context.scene;
        PathVertex* z = context.camera_path;
        PathView view;
        Rgb sum;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const uint32_t count = uint32_t(state.candidates.size());
        const float scale = float(double(count) / (double(state.cache.path_count()) * connections));
        const auto visit = [&](int t) {
            const PathVertex& v = z[t - 1];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit(scene, z, t, &view); !c.is_black()) sum += c * weight(view, 0);
            if (t > context.max_edges || count == 0 || !v.bsdf.has_smooth_lobe()) return;
            LightPick picks[kMaxConnections];
            int pick_count = 0;
            for (int n = 0; n < connections; ++n) {
                const LightCandidate& candidate = state.candidates[sampler.rng().below(count)];
                const int s = int(candidate.s);
                if (s + t - 1 > context.max_edges) continue;
                const PathVertex* y = &state.cache.vertices[candidate.first_vertex];
                prefetch(&y[s - 1]);
                picks[pick_count++] = {y, s, scale};
            }
            for (int n = 0; n < pick_count; ++n) {
                const LightPick& p = picks[n];
                const Rgb c = connect_candidate<ViewDetail::kFull>(scene, p.y, p.s, z, t, &view, &context.counters);
                if (!c.is_black()) sum += c * (p.scale * weight(view, p.s));
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            if (const Rgb c = environment_hit(scene, z, t, ray, &view); !c.is_black()) sum += c * weight(view, 0);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters,
                          visit, escape);
        return sum;
    }
};

}  // namespace lightloom
