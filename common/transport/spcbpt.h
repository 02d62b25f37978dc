#pragma once
// `spcbpt`: subspace-based probabilistic connections [Su, Li and Wang 2022]. Their Eq. 10 and 20 need corrections, see
// common/path/README.md, "Subspaces" and "Corrections of the papers".
//
// Light prefixes of the unit's cache lie in light subspaces i = kappa_L(prefix), camera suffixes in eye subspaces
// j = kappa_E(suffix). Every camera vertex draws N times (a number for the camera's first hit, t = 2, and one for later vertices,
// so that N is a function of the path): i ~ Gamma(. | j), then a prefix Y of subspace i with probability
// P2 = r(Y) / R_i, r = scalar throughput as traced, R_i its sum over the subspace's M_i = J_i M paths. Estimator:
//     (1 / N) w f / (p(Y) p(Z))  /  (M_i Gamma(i, j) P2(Y))                                       [Eq. 10 with its p(Y)]
// Effective densities, with F the measurement contribution of a prefix and L its scalar:
//     s = 0          rho = A(0)
//     s = 1          rho = n next_event A(1)                     next event estimation at the first hit, beside the cache's own
//     1 <= s <= k-1  rho = N Gamma(i, j) L(F(s)) / Q(i) A(s)                                      [Eq. 11]: the target, not
//                    what was really drawn; with ris_aware 1 / rho = 1 / rho + 1 / (M C(s) A(s)): a cache of M paths cannot
//                    deliver more than that; corrected, N c_s stands for N (common/path/corrected.h)
//     s = k          rho = N1 |crop| C(k)
// each times the share of camera sub-paths of t vertices that roulette leaves, s = k also of light sub-paths of s
// (common/path/survival.h); the draws among prefixes make up for roulette, a survivor has that much more throughput.
// Tables: kappa_L, kappa_E, Q, Gamma, J, all complete before the unit starts. Bias: none, whatever the tables hold.
// Missing: what `bdpt` misses.

#include <algorithm>
#include <memory>
#include <span>
#include <utility>

#include "common/core/inverse_cdf.h"
#include "common/path/corrected.h"
#include "common/path/survival.h"
#include "common/scene/sampling.h"
#include "common/transport/cached.h"
#include "common/transport/subspace_view.h"

namespace lightloom {

/// The tables, and values derived from them once for all units.
struct PreparedTables {
    SubspaceTables tables;
    InverseCdfTable draws;          ///< Gamma(. | j)
    std::vector<float> inv_energy;  ///< 1 / Q
    int windows = 1;                ///< Largest J.

    explicit PreparedTables(SubspaceTables t) : tables(std::move(t)), draws(tables.light_count, tables.eye_count) {
        for (uint32_t j = 0; j < tables.eye_count; ++j) draws.set(j, {tables.column(j), tables.light_count});
        for (const float q : tables.energy) inv_energy.push_back(1 / q);
        windows = largest_window(tables);
    }
    static int largest_window(const SubspaceTables& t) {
        int largest = 1;
        for (const uint16_t w : t.window) largest = std::max(largest, int(w));
        return largest;
    }
};

/// The learned tables decide how often a camera sub-path meets a prefix: N Gamma(i, j) / Q(i).
struct LearnedAffinity {
    std::shared_ptr<const PreparedTables> prepared;
    ByDepth<double> connections = 3;  ///< N

    double operator()(const PathView& view, int s, double share) const {
        const uint32_t i = view.light_label[s];
        return connections(view.k + 1 - s) * share * double(prepared->tables.column(view.eye_label[s])[i]) *
               double(prepared->inv_energy[i]);
    }
};

/// `Affinity(view, s, share)` is the expected number of draws per camera sub-path and unit of a prefix's throughput, if
/// only a share of the N draws counts.
template <class Affinity = LearnedAffinity>
struct SubspaceSelection {
    Affinity affinity;
    double light_paths_per_iteration = 1;  ///< N1 |crop|
    ByDepth<double> connections = 3;       ///< N
    double cache_paths = 0;                ///< M of ris_aware; 0 switches ris_aware off.
    TypicalSurvival survival;
    NextEventRays rays;

    struct OnPath : PlainTechniques {
        const SubspaceSelection& selection;
        PathSurvival survival;

        /// Draws among prefixes compensate for roulette: a survivor has correspondingly more throughput.
        double survivors(int s) const { return s == view.k ? survival.light(s) : survival.camera(view.k + 1 - s); }
        double next_event() const { return selection.rays.sigma(view); }
        double shadow_rays() const { return selection.rays(view.k); }
        double connections(int s) const { return selection.connections(view.k + 1 - s); }
        double connect(int s) const { return connect(s, 1); }
        double connect(int s, double share) const {
            const double target = selection.affinity(view, s, share) * view.light_throughput[s];
            const bool limited = selection.cache_paths > 0 && target > 0;
            return limited ? 1 / (1 / target + 1 / (selection.cache_paths * survival.light(s))) : target;
        }
        double lens() const { return selection.light_paths_per_iteration; }
    };
    OnPath on(const PathView& view) const { return {{view}, *this, {survival, view}}; }
    NextEventRays next_event_rays() const { return rays; }
};

/// The selection of `spcbpt`, corrected for the sub-path that its connections share.
using SpcbptSelection = Corrected<SubspaceSelection<>>;

/// The selection's parameters besides the tables; see SubspaceSelection.
struct SpcbptCounts {
    double light_paths_per_iteration = 1;
    ByDepth<int> connections = 3;
    double cache_paths = 0;
    Correction correction = Correction::kUncorrected;
    RouletteRule roulette;
    NextEventRays rays;
};

inline SpcbptSelection spcbpt_selection(std::shared_ptr<const PreparedTables> prepared, const SpcbptCounts& c) {
    const auto connections = c.connections.each([](int n) { return double(n); });
    return {{LearnedAffinity{std::move(prepared), connections}, c.light_paths_per_iteration, connections, c.cache_paths,
             TypicalSurvival(c.roulette), c.rays},
            c.correction};
}

template <class Selection = SpcbptSelection>
struct SubspaceConnections {
    Selection densities;
    std::shared_ptr<const PreparedTables> prepared;
    ByDepth<int> connections = 3;  ///< N

    const Selection& selection(const UnitScope&) const { return densities; }
    static constexpr ViewDetail kDetail = ViewDetail::kSubspace;

    static_assert(kMaxConnections <= InverseCdfTable::Column::kMaxStrata &&
                  SubspaceTables::kMaxSubspaces <= InverseCdfTable::kMaxOutcomes);

    /// A prefix and its entry in the alias table of its subspace, for draws in proportion to r.
    struct Candidate {
        LightCandidate prefix;
        float keep = 1;
        uint32_t alias = 0;  ///< Index within the subspace.
    };
    struct Subspace {
        uint32_t begin = 0, count = 0;  ///< Range of its candidates.
        ByDepth<float> scale = 0;       ///< R_i / (M_i N)
    };
    /// The cache's candidates, sorted by light subspace.
    struct Index {
        std::vector<Subspace> subspaces;
        std::vector<Candidate, HugePageAllocator<Candidate>> candidates;
    };

    uint64_t windows() const { return uint64_t(prepared->windows); }
    SubspaceLabeller labeller(const Scene& scene) const { return {prepared->tables, scene.emitters()}; }
    void label_light_path(const Scene& scene, PathVertex* y, int n) const { labeller(scene).label_light_path(y, n); }
    void label_camera_vertex(const Scene& scene, PathVertex* v) const { labeller(scene).label_camera_vertex(v); }
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                  PathView* view) const {
        labeller(scene).complete(y, s, z, t, towards, view);
    }
    float inverse_density(const LightPick& pick) const { return pick.scale / scalar_of(pick.y[pick.s - 1].alpha); }

    Index index(const LightCache& cache, uint64_t paths) const {
        const SubspaceTables& tables = prepared->tables;
        Index index;
        // This is a counting sort by subspace, in the order of the paths within each.
        index.subspaces.assign(tables.light_count, {});
        const auto each = [&](auto&& visit) {
            cache.for_each_prefix([&](const LightPrefix& p) {
                if (p.path < paths * tables.window[p.label] && p.throughput > 0 && p.throughput < HUGE_VALF) visit(p);
            });
        };
        uint32_t total = 0;
        each([&](const LightPrefix& p) { ++index.subspaces[p.label].count, ++total; });
        uint32_t begin = 0;
        for (Subspace& i : index.subspaces) i.begin = std::exchange(begin, begin + i.count);
        index.candidates.resize(total);
        std::vector<double> r(total);
        std::vector<uint32_t> filled(tables.light_count, 0);
        each([&](const LightPrefix& p) {
            const size_t at = index.subspaces[p.label].begin + filled[p.label]++;
            index.candidates[at].prefix = {p.first_vertex, p.s};
            r[at] = double(p.throughput);
        });
        fork_join(tables.light_count, [&](size_t first, size_t last) {
            std::vector<AliasEntry> entries;
            for (size_t i = first; i < last; ++i) {
                Subspace& subspace = index.subspaces[i];
                const std::span<const double> part(r.data() + subspace.begin, subspace.count);
                entries.assign(part.size(), {});
                make_alias(part, entries.data());
                double sum = 0;
                for (uint32_t c = 0; c < subspace.count; ++c) {
                    sum += part[c];
                    index.candidates[subspace.begin + c].keep = entries[c].keep;
                    index.candidates[subspace.begin + c].alias = entries[c].alias;
                }
                subspace.scale = connections.each([&](int n) { return float(sum / (double(paths) * tables.window[i] * n)); });
            }
        });
        return index;
    }

    /// Makes N draws for a labelled camera vertex, stage by stage, so that the candidates of all draws are fetched at
    /// once. One random number serves both stages and is stratified over the draws. Returns how many draws found a
    /// prefix.
    template <class Stratified>
    int draw(const LightCache& cache, const Index& index, const PathVertex& v, int t, Stratified&& stratified, Rng& rng,
             int longest_prefix, LightPick* picks) const {
        const PreparedTables& tables = *this->prepared;
        const int draw_count = connections(t);
        const InverseCdfTable::Column column = tables.draws.column(v.label);
        const Vec2 u = stratified(), below = rng.uniform2();
        // u has 24 bits; the lower bits come from the stream.
        const double base = double(u.x) + double(below.x) * 0x1p-24;
        struct Draw {
            const Candidate* candidates;
            uint32_t count, part;
            double second;
            float scale;
        } draws[kMaxConnections];
        InverseCdfTable::Draw firsts[kMaxConnections];
        column.draw_strata(base, draw_count, firsts);
        int found = 0;
        for (int n = 0; n < draw_count; ++n) {
            const InverseCdfTable::Draw& first = firsts[n];
            const Subspace& subspace = index.subspaces[first.outcome];
            if (subspace.count == 0) continue;  // the subspace is empty: its share of the estimate is zero
            Draw& d = draws[found++];
            d = {&index.candidates[subspace.begin], subspace.count, alias_part(subspace.count, first.rest), first.rest,
                 subspace.scale(t) / first.probability};
            __builtin_prefetch(&d.candidates[d.part]);
        }
        int count = 0;
        for (int n = 0; n < found; ++n) {
            const Draw& d = draws[n];
            const Candidate& part = d.candidates[d.part];
            const bool own = d.second * double(d.count) - double(d.part) < double(part.keep);
            const LightCandidate& prefix = (own ? part : d.candidates[part.alias]).prefix;
            if (int(prefix.s) > longest_prefix) continue;
            const LightVertex* y = cache.at(prefix.first_vertex);
            prefetch(&y[prefix.s - 1]);
            picks[count++] = {y, int(prefix.s), d.scale};
        }
        return count;
    }
};

template <class Selection = SpcbptSelection>
using SpcbptAlgorithm = CachedAlgorithm<SubspaceConnections<Selection>>;

}  // namespace lightloom
