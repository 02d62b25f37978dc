#pragma once
// `spcbpt`: subspace-based probabilistic connections [Su, Li and Wang 2022; algorithms.md 1.1 corrects Eq. 10 and 20].
//
// Light prefixes of the unit's cache lie in light subspaces i = kappa_L(prefix), camera suffixes in eye subspaces
// j = kappa_E(suffix). Every camera vertex draws N times: i ~ Gamma(. | j), then a prefix Y of subspace i with probability
// P2 = r(Y) / R_i, r = scalar throughput as traced, R_i its sum over the subspace's M_i = J_i M paths. Estimator:
//     (1 / N) w f / (p(Y) p(Z))  /  (M_i Gamma(i, j) P2(Y))                                       [Eq. 10 with its p(Y)]
// Effective densities, with F the measurement contribution of a prefix and L its scalar:
//     s = 0          rho = A(0)
//     1 <= s <= k-1  rho = N Gamma(i, j) L(F(s)) / Q(i) A(s)                                      [Eq. 11]: the target, not
//                    what was really drawn; with ris_aware 1 / rho = 1 / rho + 1 / (M C(s) A(s)): a cache of M paths cannot
//                    deliver more than that
//     s = k          rho = N1 |crop| C(k)
// Tables: kappa_L, kappa_E, Q, Gamma, J, all frozen before the unit. Bias: none, whatever the tables hold. Missing: what `bdpt`
// misses.

#include <algorithm>
#include <memory>

#include "common/path/mis.h"
#include "common/scene/sampling.h"
#include "common/transport/light_cache.h"
#include "common/transport/subspace_view.h"

namespace lightloom {

/// The tables and what every unit derives from them once.
struct PreparedTables {
    SubspaceTables tables;
    std::vector<AliasTable> columns;  ///< Gamma(. | j) for drawing.
    std::vector<float> inv_energy;    ///< 1 / Q
    int windows = 1;                  ///< Largest J.

    explicit PreparedTables(SubspaceTables t) : tables(std::move(t)) {
        std::vector<double> weights(tables.light_count);
        for (uint32_t j = 0; j < tables.eye_count; ++j) {
            std::copy_n(tables.column(j), tables.light_count, weights.begin());
            columns.emplace_back(weights);
        }
        for (const float q : tables.energy) inv_energy.push_back(1 / q);
        for (const uint16_t w : tables.window) windows = std::max(windows, int(w));
    }
};

struct SubspaceSelection {
    static constexpr bool kMerges = false;
    std::shared_ptr<const PreparedTables> prepared;
    double light_paths_per_iteration = 1;  ///< N1 |crop|
    double connections = 3;                ///< N
    double cache_paths = 0;                ///< M of ris_aware; 0 switches that off.

    int s_min(int) const { return 0; }
    int s_max(int k) const { return k == 1 ? 0 : k; }
    double connect_factor(const PathView& view, int s) const {
        if (s == 0) return 1;
        if (s == view.k) return light_paths_per_iteration;
        const uint32_t i = view.light_label[s];
        const double target = connections * double(prepared->tables.column(view.eye_label[s])[i]) *
                              double(prepared->inv_energy[i]) * view.light_throughput[s];
        return cache_paths > 0 && target > 0 ? 1 / (1 / target + 1 / cache_paths) : target;
    }
};

struct SpcbptAlgorithm {
    SubspaceSelection selection;
    Heuristic heuristic = Heuristic::kBalance;
    int connections = 3;         ///< N
    uint64_t minimum_paths = 1;  ///< Of a unit's cache.

    /// The cache, sorted by light subspace.
    struct State {
        LightCache cache;
        std::vector<uint32_t> begin;            ///< First candidate of a subspace; light_count + 1 entries.
        std::vector<LightCandidate> candidates;
        std::vector<double> cumulative;         ///< Of r, within its subspace, up to and including the candidate.
        std::vector<float> scale;               ///< R_i / (M_i N)
    };

    float weight(const PathView& view, int s) const {
        return float(mis_weight(view, {TechniqueKind::kConnect, s}, selection, heuristic));
    }
    SubspaceLabeller labeller(const Scene& scene) const { return {selection.prepared->tables, scene.emitters()}; }

    State prepare(const UnitScope& scope, UnitPreparation* preparation) const {
        State state;
        const SubspaceTables& tables = selection.prepared->tables;
        const SubspaceLabeller label = labeller(scope.scene);
        const uint64_t window = std::max(minimum_paths, scope.work.light_path_count);
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, auto& chunk) {
            PathView view;
            Vec2 film;
            PathVertex z0;
            z0.p = scope.scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scope.scene, y, s, z0.p, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            label.complete(y, s, &z0, 1, normalize(y[s - 1].p - z0.p), &view);
            const uint32_t pixel = uint32_t(scope.scene.frame().crop.index(int(film.x), int(film.y)));
            chunk.splats.push_back({pixel, scope.work.first_iteration, c * weight(view, s)});
        };
        state.cache = trace_light_cache(scope, window * uint64_t(selection.prepared->windows), preparation,
                                        [&](PathVertex* y, int n) { label.label_light_path(y, n); }, splat);
        if (scope.stop.stop_requested()) return state;

        // Counting sort by subspace; path order within one.
        state.begin.assign(tables.light_count + 1, 0);
        const auto each = [&](auto&& visit) {
            for (uint64_t m = 0; m < state.cache.path_count(); ++m) {
                for_each_candidate(state.cache, m, scope.max_edges, [&](const LightCandidate& c, const PathVertex& v) {
                    if (m < window * tables.window[v.label] && scalar_of(v.alpha) > 0) visit(c, v);
                });
            }
        };
        each([&](const LightCandidate&, const PathVertex& v) { ++state.begin[size_t(v.label) + 1]; });
        for (size_t i = 1; i < state.begin.size(); ++i) state.begin[i] += state.begin[i - 1];
        std::vector<uint32_t> next(state.begin.begin(), state.begin.end() - 1);
        std::vector<double> sums(tables.light_count, 0.0);
        state.candidates.resize(state.begin.back());
        state.cumulative.resize(state.begin.back());
        each([&](const LightCandidate& c, const PathVertex& v) {
            sums[v.label] += double(scalar_of(v.alpha));
            state.candidates[next[v.label]] = c;
            state.cumulative[next[v.label]++] = sums[v.label];
        });
        for (uint32_t i = 0; i < tables.light_count; ++i)
            state.scale.push_back(float(sums[i] / (double(window) * tables.window[i] * connections)));
        return state;
    }

    Rgb sample(SampleContext& context, const State& state) const {
        const Scene& scene = context.scene;
        const PreparedTables& prepared = *selection.prepared;
        const SubspaceLabeller label = labeller(scene);
        PathVertex* z = context.camera_path;
        PathView view;
        Rgb sum;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto hit_weight = [&](int t, const Vec3& towards) {
            if (view.k == 1) return 1.0f;
            label.complete(nullptr, 0, z, t, towards, &view);
            return weight(view, 0);
        };
        const auto visit = [&](int t) {
            PathVertex& v = z[t - 1];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit<ViewDetail::kSubspace>(scene, z, t, &view); !c.is_black()) sum += c * hit_weight(t, {});
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            label.label_camera_vertex(&v);
            const AliasTable& column = prepared.columns[v.label];
            // The N draws of a vertex are stratified, and at the first vertex low-discrepancy over the iterations of the pixel.
            const Vec2 u = sampler.next_event(t);
            for (int n = 0; n < connections; ++n) {
                const uint32_t i = column.sample((double(u.x) + n) / connections);
                const uint32_t begin = state.begin[i], end = state.begin[i + 1];
                if (begin == end) continue;
                const double* cumulative = state.cumulative.data();
                const double second = n == 0 ? double(u.y) : sampler.rng().uniform_double();
                const size_t chosen = std::min(
                    size_t(end - 1),
                    size_t(std::upper_bound(cumulative + begin, cumulative + end, second * cumulative[end - 1]) - cumulative));
                const LightCandidate& pick = state.candidates[chosen];
                const int s = int(pick.s);
                if (s + t - 1 > context.max_edges) continue;
                const PathVertex* y = &state.cache.vertices[pick.first_vertex];
                const Rgb c = connect_candidate<ViewDetail::kSubspace>(scene, y, s, z, t, &view, &context.counters);
                if (c.is_black()) continue;
                const PathVertex& x0 = y[s - 1];
                const bool direction = s == 1 && scene.emitters()[uint32_t(x0.emitter)].is_infinite();
                label.complete(y, s, z, t, direction ? -x0.ng : normalize(x0.p - v.p), &view);
                sum += c * (weight(view, s) * state.scale[i] / (scalar_of(x0.alpha) * column.pmf(i)));
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            if (const Rgb c = environment_hit<ViewDetail::kSubspace>(scene, z, t, ray, &view); !c.is_black())
                sum += c * hit_weight(t, ray.direction);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters,
                          visit, escape);
        return sum;
    }
};

}  // namespace lightloom
