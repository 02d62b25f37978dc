#pragma once
// `vcm`: vertex connection and merging [Georgiev, Krivanek, Davidovic and Slusallek 2012; Hachisuka, Pantaleoni and Jensen 2012].
//
// What `bdpt` does, and besides: the light sub-paths of an iteration, n of them, are photons, and a camera vertex merges with those
// in a disc of radius r around it. Effective densities, besides those of bdpt.h with N1 |crop| = n:
//   merge at x_i, 1 <= i <= k-2  rho = n a C(i+1) A(i)    a = 1 / (integral of the kernel's square): pi r^2 for the constant
//                                                         kernel, 3/4 of that for Epanechnikov's
// and at the camera's first hit, i = k-1, where merge-first is on: there light tracing does as well without bias. Dirac vertices do
// not merge. The radius is a function of the path and of the iteration alone,
//     r(j)^2 = r(0)^2 (j + 1)^(alpha - 1)                 [Knaus and Zwicker 2011, eq. 18 in its limit]
// with r(0) in pixels as they appear at the first vertex that the camera sees, mirrors and glass aside, or relative to the scene.
// Each iteration has photons of its own: a map that served several would be one sample and not several.
// With a correction, n c_i stands for n (common/path/merge_shares.h).
// Tables: the density map of the corrections vcm+ and vcm*. Bias: the kernel blurs, and discs that reach over an edge find too
// little; both vanish as r does. Missing: nothing that has a vertex to merge at.

#include <algorithm>
#include <array>
#include <memory>

#include "common/path/merge_shares.h"
#include "common/tables/density_map.h"
#include "common/transport/bdpt.h"
#include "common/transport/photon_map.h"

namespace lightloom {

/// The radius of merges, m.
struct MergeRadius {
    double per_distance2 = 0;  ///< Squared; for each square metre of PathView::footprint_distance2.
    double fixed2 = 0;         ///< Squared; for every path.
    double most2 = 0;          ///< Squared; no radius is larger.

    double squared(double distance2) const { return std::min(per_distance2 * distance2 + fixed2, most2); }
    MergeRadius scaled(double factor2) const { return {per_distance2 * factor2, fixed2 * factor2, most2 * factor2}; }
};

enum class MergeKernel : uint8_t { kConstant, kEpanechnikov };

/// The kernel at a squared distance below radius2, m^-2.
inline float kernel(MergeKernel kind, float distance2, float radius2) {
    const float constant = kInvPi / radius2;
    return kind == MergeKernel::kConstant ? constant : 2 * constant * (1 - distance2 / radius2);
}

struct VcmSelection {
    BdptSelection bdpt;
    MergeRadius radius;
    MergeKernel kernel = MergeKernel::kConstant;
    bool first_hit = false;  ///< Whether merges at x_{k-1} count.
    Correction correction = Correction::kUncorrected;

    struct OnPath : Corrected<BdptSelection>::OnPath {
        static constexpr bool kMerges = true;
        double merges;
        int last;  ///< Last vertex that may merge.
        MergeShares shares;

        double merge(int i) const { return i > last ? 0 : merges * shares(i); }
    };
    OnPath on(const PathView& view) const {
        const double disc = kPiD * radius.squared(view.footprint_distance2);
        const double area = disc * (kernel == MergeKernel::kConstant ? 1 : 0.75), n = bdpt.light_paths_per_iteration;
        const MergeRule rule{n, disc, first_hit ? view.k - 1 : view.k - 2};
        const double count = correction == Correction::kOne ? 1 : n;
        return {Corrected<BdptSelection>{bdpt, correction}.on(view), count * area, rule.last, shares_on(view, rule)};
    }
    NextEventRays next_event_rays() const { return bdpt.rays; }

  private:
    MergeShares shares_on(const PathView& view, const MergeRule& rule) const {
        switch (correction) {
            case Correction::kCorrelation: return MergeShares::correlation(view, rule);
            case Correction::kFootprint: return MergeShares::footprints(view, rule);
            case Correction::kPhotons: return MergeShares::photons(view, rule, false);
            case Correction::kPhotonsBalanced: return MergeShares::photons(view, rule, true);
            case Correction::kUncorrected:
            case Correction::kOne: return {};
        }
        return {};
    }
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
    /// The same for every path with the camera sub-path z[0 .. t-1], t >= 2: along it from the lens to its first vertex that is not
    /// a Dirac vertex.
    static double camera_distance2(const PathVertex* z, int t) {
        float distance = length(z[1].p - z[0].p);
        for (int j = 1; j + 1 < t && z[j].delta; ++j) distance += length(z[j + 1].p - z[j].p);
        return double(distance) * double(distance);
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
        if (!scope.stop.stop_requested()) state.photons = PhotonMap(state.cache);
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
        // Every camera sample is connected to a sub-path of its own where there are as many as pixels.
        const std::vector<LightCache::Path>& paths = state.cache.paths;
        const LightCache::Path none;
        const LightCache::Path& own =
            paths.empty() ? none : paths[context.pixel * paths.size() / uint64_t(scene.frame().crop.area())];
        const int n = int(own.length);
        const LightVertex* y = n > 0 ? state.cache.at(own.first_vertex) : nullptr;
        for (int s = 1; s <= n; ++s) prefetch(&y[s - 1]);

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
            view.footprint_distance2 = method.camera_distance2(z, t);
            contribute_hit<ViewDetail::kFull>(scene, z, t, &view, weigh);
            if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<ViewDetail::kFull>(scene, z, t, sampler, rays(t), &view, &context.counters, weigh);
            for (int s = 2; s <= n && s + t - 1 <= context.max_edges; ++s) {
                if (!y[s - 1].smooth) continue;
                if (const Rgb c = connect(scene, y, s, z, t, &view, &context.counters); !c.is_black())
                    weigh(from_light_path(c, Technique::connect(s), y, z, t), view);
            }
            if (t > 2 || first.first_hit) merge_near(context, state, t, &view, weigh);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            // A camera path that branches may have visited a longer branch before.
            if (t >= 2) view.footprint_distance2 = method.camera_distance2(z, t);
            if (t <= context.max_edges) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, weigh);
        };
        return trace_camera_path<branches>(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z,
                                           &context.counters, visit, escape);
    }

    /// Merges z_{t-1} with the photons around it. `view` has the footprint of the camera sub-path.
    template <class Contribute>
    void merge_near(const SampleContext& context, const State& state, int t, PathView* view, Contribute&& contribute) const {
        const PathVertex* z = context.camera_path;
        const PathVertex& v = z[t - 1];
        const float radius2 = float(state.merging.radius.squared(view->footprint_distance2));
        const float per_path = float(1 / first.bdpt.light_paths_per_iteration);
        const uint32_t longest = uint32_t(context.max_edges + 2 - t);
        struct Near {
            const LightVertex* y;
            int s;
            float distance2;
        };
        // The photons of a disc are far apart in memory, and so they are all asked for before the first is read.
        std::array<Near, 32> near;
        size_t count = 0;
        const auto merge_all = [&] {
            for (size_t i = 0; i < count; ++i) {
                const auto& [y, s, distance2] = near[i];
                if (abs_dot(y[s - 1].ng, v.ng) < kSameSurface) continue;
                const Rgb c = merge(context.scene, y, s, z, t, view);
                if (c.is_black()) continue;
                const float scale = per_path * kernel(first.kernel, distance2, radius2);
                PathContribution found = from_light_path(c * scale, Technique::merge(s - 1), y, z, t);
                found.inverse_density = scale;
                contribute(found, *view);
            }
            count = 0;
        };
        state.photons.for_each_near(v.p, radius2, [&](const PhotonMap::Photon& photon, float distance2) {
            if (photon.s > longest) return;
            const LightVertex* y = state.cache.at(photon.first_vertex);
            for (uint32_t i = 0; i < photon.s; ++i) prefetch(&y[i]);
            near[count++] = {y, int(photon.s), distance2};
            if (count == near.size()) merge_all();
        });
        merge_all();
    }

    /// Least cosine between the geometric normals of two vertices that merge: those of a box's edge do not.
    static constexpr float kSameSurface = 0.7f;
};

}  // namespace lightloom
