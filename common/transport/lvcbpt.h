#pragma once
// `lvcbpt`: bidirectional path tracing with a light-vertex cache and uniform selection [Davidovic, Krivanek, Hasan and Slusallek
// 2014, section 4.1; the baseline of Su, Li and Wang 2022].
//
// Every camera vertex is connected to N(t) prefixes drawn uniformly from the unit's cache (V prefixes of M paths); N(t) is one
// number for the camera's first hit, t = 2, and one for later vertices. Densities, with t = k + 1 - s:
//   s = 0          rho = A(0)
//   s = 1          rho = n next_event A(1)     next event estimation at the first hit, beside the cache's own
//   1 <= s <= k-1  rho = N(t) / v  C(s) A(s)    v: expected number of prefixes per light path, a table. The estimator divides by
//                                               what was really done, V / (M N): the weight must not know the realised V
//   s = k          rho = N1 |crop| C(k)
// each times the share of light sub-paths of s vertices and of camera sub-paths of t vertices that survive roulette
// (common/path/survival.h). Tables: v (vertices_per_path). Bias: none. Missing: what `bdpt` misses.

#include "common/path/corrected.h"
#include "common/path/survival.h"
#include "common/transport/cached.h"

namespace lightloom {

struct UniformSelection {
    double light_paths_per_iteration = 1;  ///< N1 |crop|
    ByDepth<double> connection_density;    ///< N / v
    TypicalSurvival survival;
    NextEventRays rays;
    ByDepth<double> connections = 1;  ///< N

    struct OnPath : PlainTechniques {
        const UniformSelection& selection;
        PathSurvival survival;

        double survivors(int s) const { return survival.light(s) * survival.camera(view.k + 1 - s); }
        double next_event() const { return selection.rays.sigma(view); }
        double shadow_rays() const { return selection.rays(view.k); }
        double connections(int s) const { return selection.connections(view.k + 1 - s); }
        double connect(int s) const { return selection.connection_density(view.k + 1 - s); }
        double connect(int s, double share) const { return connect(s) * share; }
        double lens() const { return selection.light_paths_per_iteration; }
    };
    OnPath on(const PathView& view) const { return {{view}, *this, {survival, view}}; }
    NextEventRays next_event_rays() const { return rays; }
};

template <class Selection = UniformSelection>
struct UniformConnections {
    Selection densities;
    ByDepth<int> connections = 3;  ///< N

    const Selection& selection(const UnitScope&) const { return densities; }
    static constexpr ViewDetail kDetail = ViewDetail::kFull;
    struct Index {
        std::vector<LightCandidate> candidates;
        ByDepth<float> inverse_density;  ///< V / (M N), with the V that the cache really has.
    };

    uint64_t windows() const { return 1; }
    void label_light_path(const Scene&, PathVertex*, int) const {}
    void label_camera_vertex(const Scene&, PathVertex*) const {}
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3&, PathView* view) const {
        if constexpr (kReadsFootprint<Selection>) view_footprint(scene.emitters(), y, s, z, t, view);
    }
    float inverse_density(const LightPick& pick) const { return pick.scale; }

    Index index(const LightCache& cache, uint64_t paths) const {
        Index index;
        cache.for_each_prefix([&](const LightPrefix& p) { index.candidates.push_back({p.first_vertex, p.s}); });
        index.inverse_density =
            connections.each([&](int n) { return float(double(index.candidates.size()) / (double(paths) * n)); });
        return index;
    }

    template <class Stratified>
    int draw(const LightCache& cache, const Index& index, const PathVertex&, int t, Stratified&&, Rng& rng, int longest_prefix,
             LightPick* picks) const {
        const uint32_t count = uint32_t(index.candidates.size());
        const float inverse_density = index.inverse_density(t);
        int found = 0;
        for (int n = 0; n < connections(t) && count > 0; ++n) {
            const LightCandidate& prefix = index.candidates[rng.below(count)];
            if (int(prefix.s) > longest_prefix) continue;
            const LightVertex* y = cache.at(prefix.first_vertex);
            prefetch(&y[prefix.s - 1]);
            picks[found++] = {y, int(prefix.s), inverse_density};
        }
        return found;
    }
};

template <class Selection = UniformSelection>
using LvcbptAlgorithm = CachedAlgorithm<UniformConnections<Selection>>;

}  // namespace lightloom
