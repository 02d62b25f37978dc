#pragma once
// `vcm`: vertex connection and merging [Georgiev, Krivanek, Davidovic and Slusallek 2012; Hachisuka, Pantaleoni and Jensen 2012].
//
// What `bdpt` does, and besides: the light sub-paths of an iteration, n of them, are photons, and a camera vertex merges with those
// in a disc of radius r around it. Effective densities, besides those of bdpt.h with N1 |crop| = n:
//   merge at x_i, 1 <= i <= k-2  rho = n a C(i+1) A(i)    a = 1 / (integral of the kernel's square): pi r^2 for the constant
//                                                         kernel, 3/4 of that for Epanechnikov's
// and at the camera's first hit, i = k-1, where merge-first is on: there light tracing does as well without bias. Dirac vertices do
// not merge. A camera vertex is connected to N of the n sub-paths, so that rho = N C(s) A(s) for 2 <= s <= k-1. The radius is a
// function of the path and of the iteration alone,
//     r(j)^2 = r(0)^2 (j + 1)^(alpha - 1)                 [Knaus and Zwicker 2011, eq. 18 in its limit]
// with r(0) in pixels as they appear at the first vertex that the camera sees, mirrors and glass aside, or relative to the scene.
// Each iteration has photons of its own: a map that served several would be one sample and not several.
// With a correction, n c_i stands for n (common/path/merge_shares.h).
// Tables: the density map of the corrections vcm+ and vcm*. Bias: the kernel blurs, and discs that reach over an edge find too
// little; both vanish as r does. Missing: nothing that has a vertex to merge at.

#include <algorithm>
#include <memory>

#include "common/path/merge_shares.h"
#include "common/tables/density_map.h"
#include "common/transport/bdpt.h"
#include "common/transport/merging.h"
#include "common/transport/photon_memory.h"

namespace lightloom {

/// bdpt's techniques with N light sub-paths for a camera vertex.
struct ConnectedSubPaths : BdptSelection {
    ByDepth<double> number = 1;  ///< N

    struct OnPath : BdptSelection::OnPath {
        ByDepth<double> number;

        double connections(int s) const { return number(view.k + 1 - s); }
        double connect(int s) const { return s == 1 ? 0 : connections(s); }
        double connect(int s, double share) const { return connect(s) * share; }
    };
    OnPath on(const PathView& view) const { return {BdptSelection::on(view), number}; }
};

struct VcmSelection {
    ConnectedSubPaths bdpt;
    MergeRadius radius;
    MergeKernel kernel = MergeKernel::kConstant;
    bool first_hit = false;  ///< Whether merges at x_{k-1} count.
    Correction correction = Correction::kUncorrected;

    struct OnPath : Corrected<ConnectedSubPaths>::OnPath {
        static constexpr bool kMerges = true;
        double merges;
        int last;  ///< Last vertex that may merge.
        MergeShares shares;

        double merge(int i) const { return i > last ? 0 : merges * shares(i); }
    };
    OnPath on(const PathView& view) const {
        const double disc = kPiD * radius.squared(view.footprint_distance2), n = bdpt.light_paths_per_iteration;
        const double area = disc * (kernel == MergeKernel::kConstant ? 1 : 0.75);
        const MergeRule rule{n, disc, first_hit ? view.k - 1 : view.k - 2};
        return {Corrected<ConnectedSubPaths>{bdpt, correction}.on(view), n * area, rule.last,
                MergeShares::of(correction, view, rule)};
    }
    NextEventRays next_event_rays() const { return bdpt.rays; }
};

/// What weights of single paths need to know (unit_renderer.h), at the radius of the first iteration.
template <class Selection = VcmSelection>
struct VcmMethod {
    Selection densities;
    Correction correction = Correction::kUncorrected;
    std::shared_ptr<const DensityMap> photons;  ///< Null: nothing is known.

    static constexpr ViewDetail kDetail = ViewDetail::kFull;
    /// Labels are those of the density map.
    void label_light_path(const Scene&, PathVertex* y, int n) const {
        if (!photons) return;
        for (int i = 1; i < n; ++i) y[i].label = photons->label(y[i].p);
    }
    void label_camera_vertex(const Scene&, PathVertex* v) const {
        if (photons) v->label = photons->label(v->p);
    }
    /// Sets footprint_distance2, primary_distance2, source, photons and edge of a path's view.
    void complete(const Scene& scene, const LightSubPath& y, int s, const PathVertex* z, int t, const Vec3&, PathView* view) const {
        view_footprint(scene.emitters(), y, s, z, t, view);
        // With t = 1, x_{k-1} is no Dirac vertex.
        view->footprint_distance2 = t >= 2 ? camera_distance2(z, t) : view->primary_distance2;
        view_photons(y, z, t, view);
        const bool hit = s == 0 && view->k == t - 1;
        const int32_t emitter = s > 0 ? y[0].emitter : hit ? z[t - 1].emitter : scene.emitters().environment_index();
        view_edges(scene.emitters()[uint32_t(emitter)], s > 0 ? y[0].p : z[t - 1].p, y, z, t, view);
    }
    /// What the correction reads besides what all paths of a camera sub-path have in common; x_0 is at `start`.
    LL_ALWAYS_INLINE void complete_for_correction(const Emitter& e, const Vec3& start, const LightSubPath& y, const PathVertex* z,
                                                  int t, PathView* view) const {
        view->source = light_source(e);
        if (correction == Correction::kFootprint) view_edges(e, start, y, z, t, view);
        if (correction == Correction::kPhotons || correction == Correction::kPhotonsBalanced) view_photons(y, z, t, view);
    }

  private:
    // Where both sub-paths have x_i, because they merged there, the camera's place is that of the path.
    void view_photons(const LightSubPath& y, const PathVertex* z, int t, PathView* view) const {
        const int k = view->k;
        const auto density = [&](uint16_t label) { return photons && label != kNoLabel ? photons->density(label) : 0; };
        for (int i = 1; i < k && k - i >= t; ++i) view->photons[i] = density(y[i].label);
        for (int j = 1; j < t && j < k; ++j) view->photons[k - j] = density(z[j].label);
    }
    static void view_edges(const Emitter& e, const Vec3& start, const LightSubPath& y, const PathVertex* z, int t, PathView* view) {
        const int k = view->k;
        const auto place = [&](int i) { return i == 0 ? start : k - i < t ? z[k - i].p : y[i].p; };
        view->edge[0] = e.is_infinite() ? 0 : length(place(1) - start);
        for (int i = 1; i < k; ++i) view->edge[i] = length(place(i + 1) - place(i));
    }
};

/// `Select` leaves techniques out, see make_unit_renderer().
template <class Select>
struct VcmAlgorithm {
    using Selection = decltype(std::declval<const Select&>()(VcmSelection{}));

    Select select;
    VcmSelection first;  ///< Of the first iteration.
    double alpha = 1;
    Heuristic heuristic = Heuristic::kBalance;
    std::shared_ptr<const DensityMap> density{};  ///< Null: nothing is known.
    VcmMethod<Selection> method{select(first), first.correction, density};

    static constexpr bool kPerIteration = true;

    struct State {
        VcmSelection merging;
        Selection selection;
        LightCache cache;
        PhotonMap photons;
    };

    float weight(const State& state, const PathView& view, Technique own) const {
        return float(mis_weight(view, own, state.selection.on(view), heuristic));
    }

    /// Traces the photons of an iteration; see cached.h.
    template <class Contribute>
    State prepare(const UnitScope& scope, UnitPreparation* preparation, Contribute&& contribute) const {
        VcmSelection now = first;
        now.radius = first.radius.scaled(math::pow(1 + double(scope.work.group_first_iteration), alpha - 1));
        State state{.merging = now, .selection = select(now), .cache = {}, .photons = {}};
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, uint64_t m, auto& chunk) {
            PathView view;
            PathVertex z0;
            Vec2 film;
            z0.p = scope.scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scope.scene, y, s, &z0.p, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            const PathContribution found = from_light_path(c, Technique::lens(s), y, &z0, 1, film);
            view.primary_distance2 = view.footprint_distance2 = double(length_squared(y[s - 1].p - z0.p));
            method.complete_for_correction(scope.scene.emitters()[found.emitter], y[0].p, y, &z0, 1, &view);
            contribute(found, view, weight(state, view, found.technique), m, chunk);
        };
        state.cache = trace_light_cache(
            scope, scope.work.light_path_count, preparation,
            [&](PathVertex* y, int n) { method.label_light_path(scope.scene, y, n); }, splat);
        state.cache.prefixes = {};
        if (!scope.stop.stop_requested()) {
            state.photons = PhotonMap(state.cache);
            note_photon_memory({state.cache.memory_bytes(), state.photons.memory_bytes()});
        }
        return state;
    }

    template <class Contribute>
    int trace(SampleContext& context, const State& state, Contribute&& contribute) const {
        return context.roulette.gain ? trace_walk<true>(context, state, contribute) : trace_walk<false>(context, state, contribute);
    }

  private:
    template <bool branches, class Contribute>
    int trace_walk(SampleContext& context, const State& state, Contribute&& contribute) const {
        const Scene& scene = context.scene;
        PathVertex* z = context.camera_path;
        PathView view;
        // Every camera sample is connected to a sub-path of its own where there are as many as pixels, and to others of the frame
        // if there are to be several.
        const std::vector<LightCache::Path>& paths = state.cache.paths;
        const uint64_t own = context.pixel * paths.size() / uint64_t(scene.frame().crop.area());
        const ByDepth<int> connections = first.bdpt.number.each([](double n) { return int(n); });
        const uint64_t stride = std::max<uint64_t>(1, paths.size() / uint64_t(std::max(connections.at_first, connections.later)));
        const auto sub_path = [&](int c) {
            return paths.empty() ? LightCache::Path{} : paths[(own + uint64_t(c) * stride) % paths.size()];
        };
        const LightCache::Path nearest = sub_path(0);
        if (nearest.length > 0)
            for (const LightVertex *y = state.cache.at(nearest.first_vertex), *end = y + nearest.length; y != end; ++y) prefetch(y);

        const NextEventRays rays = state.selection.next_event_rays();
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        // What VcmMethod::complete() sets: the same for all paths of a camera sub-path but for the kind of light.
        const auto weigh = [&](const PathContribution& c, PathView& v) LL_ALWAYS_INLINE {
            method.complete_for_correction(scene.emitters()[c.emitter], c.position, c.y, c.z, c.t, &v);
            contribute(c, v);
        };
        const auto visit = [&](int t) {
            method.label_camera_vertex(scene, &z[t - 1]);
            if (t == 2) view.primary_distance2 = double(length_squared(z[1].p - z[0].p));
            view.footprint_distance2 = camera_distance2(z, t);
            contribute_hit<ViewDetail::kFull>(scene, z, t, &view, weigh);
            if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<ViewDetail::kFull>(scene, z, t, sampler, rays(t), &view, &context.counters, weigh);
            const float share = 1 / float(connections(t));
            for (int c = 0; c < connections(t); ++c) {
                const LightCache::Path path = c == 0 ? nearest : sub_path(c);
                const LightVertex* y = path.length > 0 ? state.cache.at(path.first_vertex) : nullptr;
                for (int s = 2; s <= int(path.length) && s + t - 1 <= context.max_edges; ++s) {
                    if (!y[s - 1].smooth) continue;
                    const Rgb value = connect(scene, y, s, z, t, &view, &context.counters);
                    if (value.is_black()) continue;
                    PathContribution found = from_light_path(value * share, Technique::connect(s), y, z, t);
                    found.inverse_density = share;
                    weigh(found, view);
                }
            }
            if (t > 2 || first.first_hit) {
                const Disc disc{float(state.merging.radius.squared(view.footprint_distance2)),
                                float(1 / first.bdpt.light_paths_per_iteration), first.kernel};
                merge_near<ViewDetail::kFull>(scene, state.cache, state.photons, disc, context.max_edges, z, t, &view, weigh);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            // A camera path that branches may have visited a longer branch before.
            if (t >= 2) view.footprint_distance2 = camera_distance2(z, t);
            if (t <= context.max_edges) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, weigh);
        };
        return trace_camera_path<branches>(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z,
                                           &context.counters, visit, escape);
    }
};

}  // namespace lightloom
