#pragma once
// The bidirectional algorithms with a light-vertex cache, but for what tells them apart. A method says which prefixes of
// the cache a camera vertex is connected to, and with what densities the weights reckon:
//
//   struct Method {
//       Selection selection;                     // the MIS densities, common/path/mis.h
//       static constexpr ViewDetail kDetail;
//       struct / using Index;                    // of a unit's cache, frozen before the first camera sample
//       uint64_t windows() const;                // light-only repetitions of the cache that the index may reach into
//       Index index(const LightCache&, uint64_t paths) const;                              // paths: of one window
//       void label_light_path(const Scene&, PathVertex* y, int n) const;
//       void label_camera_vertex(const Scene&, PathVertex* v) const;
//       void complete(const Scene&, const PathVertex* y, int s, PathVertex* z, int t, const Vec3& towards, PathView*) const;
//       int draw(const LightCache&, const Index&, const PathVertex& v, Stratified&& u, Rng&, int longest_prefix,
//                LightPick*) const;                  // u(): a point of the vertex that is stratified where that helps
//       float inverse_density(const LightPick&) const;                                      // see PathContribution
//   };
//
// s = 0 (emitter hits) and s = k (every counted light sub-path to the lens) are the same for all of them.

#include "common/path/mis.h"
#include "common/transport/contribution.h"
#include "common/transport/light_cache.h"

namespace lightloom {

template <class Method>
struct CachedAlgorithm {
    Method method;
    Heuristic heuristic = Heuristic::kBalance;
    uint64_t minimum_paths = 1;  ///< Of a unit's cache.

    struct State {
        LightCache cache;
        typename Method::Index index;
    };

    float weight(const PathView& view, int s) const {
        return float(mis_weight(view, {TechniqueKind::kConnect, s}, method.selection, heuristic));
    }

    /// Traces a unit's light sub-paths. `contribute(contribution, view, m, chunk)` is called for every counted one, m, that
    /// reaches the lens.
    template <class Contribute>
    State prepare(const UnitScope& scope, UnitPreparation* preparation, Contribute&& contribute) const {
        const Scene& scene = scope.scene;
        State state;
        const uint64_t window = std::max(minimum_paths, scope.work.light_path_count);
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, uint64_t m, auto& chunk) {
            PathView view;
            PathVertex z0;
            Vec2 film;
            z0.p = scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scene, y, s, z0.p, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            method.complete(scene, y, s, &z0, 1, normalize(y[s - 1].p - z0.p), &view);
            contribute(PathContribution{c, 1, s, 1, y, &z0, y[0].p, y[0].ng, uint32_t(y[0].emitter), film, y[s - 1].survival}, view,
                       m, chunk);
        };
        state.cache = trace_light_cache(
            scope, window * method.windows(), preparation, [&](PathVertex* y, int n) { method.label_light_path(scene, y, n); },
            splat);
        if (!scope.stop.stop_requested()) state.index = method.index(state.cache, window);
        state.cache.prefixes = {};
        return state;
    }
    State prepare(const UnitScope& scope, UnitPreparation* preparation) const {
        return prepare(scope, preparation, [&](const PathContribution& c, const PathView& view, uint64_t, auto& chunk) {
            const uint32_t pixel = uint32_t(scope.scene.frame().crop.index(int(c.film.x), int(c.film.y)));
            chunk.splats.push_back({pixel, scope.work.first_iteration, c.value * weight(view, c.s)});
        });
    }

    /// Traces one camera sample and calls contribute(contribution, view) for everything that it gives.
    template <class Contribute>
    void trace(SampleContext& context, const State& state, Contribute&& contribute) const {
        const Scene& scene = context.scene;
        PathVertex* z = context.camera_path;
        PathView view;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) {
            PathVertex& v = z[t - 1];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit<Method::kDetail>(scene, z, t, &view); !c.is_black()) {
                    if (view.k >= 2) method.complete(scene, nullptr, 0, z, t, {}, &view);
                    contribute(PathContribution{c, 1, 0, t, nullptr, z, v.p, v.ng, uint32_t(v.emitter), {}, v.survival}, view);
                }
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            method.label_camera_vertex(scene, &v);
            LightPick picks[kMaxConnections];
            // Low-discrepancy at the first vertex, over the iterations of the pixel.
            const int count = method.draw(
                state.cache, state.index, v, [&] { return sampler.next_event(t); }, sampler.rng(), context.max_edges + 1 - t,
                picks);
            for (int n = 0; n < count; ++n) {
                const LightPick& pick = picks[n];
                const int s = pick.s;
                const Rgb c = connect_candidate<Method::kDetail>(scene, pick.y, s, z, t, &view, &context.counters);
                if (c.is_black()) continue;
                const PathVertex &start = pick.y[0], &end = pick.y[s - 1];
                const bool direction = s == 1 && scene.emitters()[uint32_t(end.emitter)].is_infinite();
                method.complete(scene, pick.y, s, z, t, direction ? -end.ng : normalize(end.p - v.p), &view);
                const float scale = method.inverse_density(pick);
                // Where a light sub-path from an infinite light began says nothing about this one: x_0 is a direction.
                const Vec3 x0 = direction ? scene.emitters().outside(v.p, -end.ng) : start.p;
                contribute(
                    PathContribution{
                        c * scale, scale, s, t, pick.y, z, x0, start.ng, uint32_t(start.emitter), {}, end.survival * v.survival},
                    view);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            const Rgb c = environment_hit<Method::kDetail>(scene, z, t, ray, &view);
            if (c.is_black()) return;
            if (view.k >= 2) method.complete(scene, nullptr, 0, z, t, ray.direction, &view);
            const EmitterSet& emitters = scene.emitters();
            contribute(PathContribution{c,
                                        1,
                                        0,
                                        t,
                                        nullptr,
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

    Rgb sample(SampleContext& context, const State& state) const {
        Rgb sum;
        trace(context, state, [&](const PathContribution& c, const PathView& view) { sum += c.value * weight(view, c.s); });
        return sum;
    }
};

}  // namespace lightloom
