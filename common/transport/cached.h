#pragma once
// The common part of the bidirectional algorithms with a light-vertex cache. A method decides which prefixes of the
// cache a camera vertex is connected to, and which densities the weights use:
//
//   struct Method {
//       Selection selection(const UnitScope&) const;   // the densities of one unit's weights (common/path/mis.h) and
//                                                      // the rays of its next event estimation besides s = 1 from the
//                                                      // cache; made before the unit's first sub-path; if it traces
//                                                      // sub-paths itself, their random streams are its own
//       Selection densities;                           // if all units have the same, so that single paths can be
//                                                      // weighted
//       static constexpr bool kUnitSelection;          // optional; true if they depend on the unit beyond its group
//       static constexpr bool kMerges;                 // optional; true if camera vertices merge with the cache's vertices, too:
//                                                      // then each iteration has a cache of its own, and units are whole frames
//       MergeTerms merging(const UnitScope&) const;    // only where kMerges
//       static constexpr ViewDetail kDetail;
//       struct / using Index;                          // of a unit's cache, complete before the first camera sample
//       uint64_t windows() const;                      // number of windows of light paths that the index may use
//       Index index(const LightCache&, uint64_t paths) const;                              // paths: of one window
//       void label_light_path(const Scene&, PathVertex* y, int n) const;
//       void label_camera_vertex(const Scene&, PathVertex* v) const;
//       void complete(const Scene&, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards, PathView*) const;
//       int draw(const LightCache&, const Index&, const PathVertex& v, int t, Stratified&& u, Rng&, int longest_prefix,
//                LightPick*) const;                    // v: the last vertex of a camera sub-path of t; u(): a point of the
//                                                      // vertex that is stratified where that helps
//       float inverse_density(const LightPick&) const; // see PathContribution
//   };
//
// Emitter hits, next event estimation, and connections of every counted light sub-path to the lens are the same for all of them.

#include "common/path/mis.h"
#include "common/transport/contribution.h"
#include "common/transport/light_cache.h"
#include "common/transport/merging.h"
#include "common/transport/photon_memory.h"

namespace lightloom {

template <class Method>
struct CachedAlgorithm {
    Method method;
    Heuristic heuristic = Heuristic::kBalance;
    uint64_t minimum_paths = 1;  ///< Least light paths in a unit's cache.

    static constexpr bool kUnitSelection = [] {
        if constexpr (requires { Method::kUnitSelection; }) return Method::kUnitSelection;
        return false;
    }();

    static constexpr bool kMerges = [] {
        if constexpr (requires { Method::kMerges; }) return Method::kMerges;
        return false;
    }();
    /// A map that served several iterations would be one sample and not several.
    static constexpr bool kPerIteration = kMerges;

    /// What a state has for merges.
    struct Photons {
        MergeTerms terms;
        PhotonMap map;
        uint64_t paths = 0;  ///< That the map is of.
    };
    struct NoPhotons {};

    using Selection = std::remove_cvref_t<decltype(std::declval<const Method&>().selection(std::declval<const UnitScope&>()))>;
    struct State {
        Selection selection;
        LightCache cache;
        typename Method::Index index;
        [[no_unique_address]] std::conditional_t<kMerges, Photons, NoPhotons> photons;
    };

    float weight(const Selection& selection, const PathView& view, Technique own) const {
        return float(mis_weight(view, own, selection.on(view), heuristic));
    }
    float weight(const State& state, const PathView& view, Technique own) const { return weight(state.selection, view, own); }

    /// Traces a unit's light sub-paths. `contribute(contribution, view, weight, m, chunk)` is called for every counted
    /// sub-path m that reaches the lens.
    template <class Contribute>
    State prepare(const UnitScope& scope, UnitPreparation* preparation, Contribute&& contribute) const {
        const Scene& scene = scope.scene;
        State state{.selection = method.selection(scope), .cache = {}, .index = {}, .photons = {}};
        const uint64_t window = std::max(minimum_paths, scope.work.light_path_count);
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, uint64_t m, auto& chunk) {
            PathView view;
            PathVertex z0;
            Vec2 film;
            z0.p = scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scene, y, s, &z0.p, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            method.complete(scene, y, s, &z0, 1, normalize(y[s - 1].p - z0.p), &view);
            const PathContribution found = from_light_path(c, Technique::lens(s), y, &z0, 1, film);
            contribute(found, view, weight(state.selection, view, found.technique), m, chunk);
        };
        state.cache = trace_light_cache(
            scope, window * method.windows(), preparation, [&](PathVertex* y, int n) { method.label_light_path(scene, y, n); },
            splat);
        if (!scope.stop.stop_requested()) state.index = method.index(state.cache, window);
        state.cache.prefixes = {};
        if constexpr (kMerges) {
            if (!scope.stop.stop_requested()) {
                state.photons = {method.merging(scope), PhotonMap(state.cache), state.cache.path_count()};
                note_photon_memory({state.cache.memory_bytes(), state.photons.map.memory_bytes()});
            }
        }
        return state;
    }

    /// Traces one camera sample and calls contribute(contribution, view) for each of its contributions. Returns the number of
    /// its camera vertices.
    template <class Contribute>
    int trace(SampleContext& context, const State& state, Contribute&& contribute) const {
        return context.roulette.gain ? trace_walk<true>(context, state, contribute) : trace_walk<false>(context, state, contribute);
    }

  private:
    template <bool branches, class Contribute>
    int trace_walk(SampleContext& context, const State& state, Contribute&& contribute) const {
        constexpr ViewDetail kDetail = Method::kDetail;
        const Scene& scene = context.scene;
        const NextEventRays rays = state.selection.next_event_rays();
        PathVertex* z = context.camera_path;
        PathView view;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) {
            PathVertex& v = z[t - 1];
            contribute_hit<kDetail>(scene, z, t, &view, [&](const PathContribution& c, PathView&) {
                if (view.k >= 2) method.complete(scene, {}, 0, z, t, {}, &view);
                contribute(c, view);
            });
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            method.label_camera_vertex(scene, &v);
            if (const int shadow_rays = rays(t)) {
                contribute_next_event<kDetail>(
                    scene, z, t, sampler, shadow_rays, &view, &context.counters, [&](const PathContribution& c, PathView&) {
                        PathVertex y0;
                        y0.p = c.position, y0.ng = c.normal, y0.emitter = int32_t(c.emitter);
                        method.label_light_path(scene, &y0, 1);
                        const bool direction = scene.emitters()[c.emitter].is_infinite();
                        method.complete(scene, &y0, 1, z, t, direction ? -y0.ng : normalize(y0.p - v.p), &view);
                        contribute(c, view);
                    });
            }
            LightPick picks[kMaxConnections];
            // The first vertex uses low-discrepancy points over the iterations of the pixel.
            const int count = method.draw(
                state.cache, state.index, v, t, [&] { return sampler.connection(t); }, sampler.rng(), context.max_edges + 1 - t,
                picks);
            for (int n = 0; n < count; ++n) picks[n].y[picks[n].s - 1].prefetch_surface();
            for (int n = 0; n < count; ++n) {
                const LightPick& pick = picks[n];
                const int s = pick.s;
                const Rgb c = connect_candidate<kDetail>(scene, pick.y, s, z, t, &view, &context.counters);
                if (c.is_black()) continue;
                const LightVertex &start = pick.y[0], &end = pick.y[s - 1];
                const bool direction = s == 1 && scene.emitters()[uint32_t(end.emitter)].is_infinite();
                method.complete(scene, pick.y, s, z, t, direction ? -end.ng : normalize(end.p - v.p), &view);
                const float scale = method.inverse_density(pick);
                contribute(PathContribution{.value = c * scale,
                                            .inverse_density = scale,
                                            .technique = Technique::connect(s),
                                            .t = t,
                                            .y = pick.y,
                                            .z = z,
                                            // x_0 is a direction; the place where a light sub-path from an infinite
                                            // light began does not matter here.
                                            .position = direction ? scene.emitters().outside(v.p, -end.ng) : start.p,
                                            .normal = start.ng,
                                            .emitter = uint32_t(start.emitter),
                                            .survival = end.survival * v.survival},
                           view);
            }
            if constexpr (kMerges) {
                const auto& [terms, map, paths] = state.photons;
                if (t == 2 && !terms.first_hit) return;
                const Disc disc{float(terms.radius.squared(camera_distance2(z, t))), float(1 / double(paths)), terms.kernel};
                merge_near<kDetail>(scene, state.cache, map, disc, context.max_edges, z, t, &view,
                                    [&](const PathContribution& c, PathView&) {
                                        method.complete(scene, c.y, c.technique.light_vertices(), z, t, {}, &view);
                                        contribute(c, view);
                                    });
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            contribute_escape<kDetail>(scene, z, t, ray, &view, [&](const PathContribution& c, PathView&) {
                if (view.k >= 2) method.complete(scene, {}, 0, z, t, ray.direction, &view);
                contribute(c, view);
            });
        };
        return trace_camera_path<branches>(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z,
                                           &context.counters, visit, escape);
    }
};

}  // namespace lightloom
