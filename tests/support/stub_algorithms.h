#pragma once
// Stand-ins for future methods, made of production pieces only. They show that pairing over the whole frame and merging
// need no change of the core. They are slow on purpose (every photon is examined) and never part of the product.

#include "common/transport/bdpt.h"
#include "common/transport/unit_renderer.h"
#include "tests/support/estimates.h"
#include "tests/support/path_rebuild.h"

namespace lightloom::testing {

/// Vertex merging with a fixed radius on top of classic connections [Georgiev et al. 2012].
struct MergeStubSelection {
    BdptSelection connections;
    double light_paths = 4096, radius = 0.02;

    struct OnPath : BdptSelection::OnPath {
        static constexpr bool kMerges = true;
        double merges;
        double merge(int) const { return merges; }
    };
    OnPath on(const PathView& view) const { return OnPath{connections.on(view), light_paths * kPiD * radius * radius}; }
};

/// Pairs every camera sub-path with `pairs` light sub-paths chosen over the whole frame (matrix BDPT's shape): each light path is
/// equally likely, so sigma of a connection is the number of pairs.
struct PairingStubSelection {
    BdptSelection connections;
    double pairs = 4;

    struct OnPath : BdptSelection::OnPath {
        double pairs;
        double connect(int s) const { return pairs * BdptSelection::OnPath::connect(s); }
    };
    OnPath on(const PathView& view) const { return OnPath{connections.on(view), pairs}; }
};

/// Weights of single paths by a selection without labels.
template <class Selection>
std::unique_ptr<PathWeights> weights_of(const Selection& selection, Heuristic heuristic = Heuristic::kBalance) {
    return std::make_unique<lightloom::detail::PlainWeights<Selection>>(selection, heuristic);
}

/// Light sub-paths of a whole frame, each at its full length.
using LightPool = std::vector<std::vector<PathVertex>>;

inline LightPool trace_light_pool(const Scene& scene, uint64_t seed, int count, int max_edges) {
    LightPool pool(static_cast<size_t>(count));
    WalkCounters counters;
    for (size_t i = 0; i < pool.size(); ++i) {
        LightSampler sampler({seed, Stage::kLightPool, 0, i});
        pool[i].resize(size_t(max_edges));
        pool[i].resize(size_t(trace_light_path(scene, sampler, max_edges, {}, pool[i].data(), &counters)));
    }
    return pool;
}

/// bdpt whose light vertices come from a pool: `pairs` of its paths are connected, and with a positive radius all
/// vertices are merged.
template <class Selection>
struct PoolAlgorithm {
    Selection selection;
    const LightPool* pool;
    int pairs = 1;
    float radius = 0;        ///< 0: no merges.
    bool add_merges = true;  ///< False: merges keep their share of the weights, but their light is left out.

    float weight(const PathView& view, Technique own) const { return float(mis_weight(view, own, selection.on(view))); }

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        const Scene& scene = context.scene;
        PathVertex *own = context.light_path_vertices, *z = context.camera_path;
        PathView view;
        LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, own, &context.counters);
        contribute_to_lens(scene, light_sampler, own, n, z, &view, &context.counters, contribute);

        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        Rng choice({context.seed, Stage::kPairing, context.iteration, context.pixel});
        const auto visit = [&](int t) {
            contribute_hit<ViewDetail::kFull>(scene, z, t, &view, contribute);
            if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<ViewDetail::kFull>(scene, z, t, sampler, 1, &view, &context.counters, contribute);
            for (int q = 0; q < pairs; ++q) {
                const std::vector<PathVertex>& y = (*pool)[choice.below(uint32_t(pool->size()))];
                for (int s = 2; s <= int(y.size()) && s + t - 1 <= context.max_edges; ++s) {
                    if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                    const Rgb c = connect(scene, y.data(), s, z, t, &view, &context.counters);
                    if (!c.is_black()) contribute(from_light_path(c / float(pairs), Technique::connect(s), y.data(), z, t), view);
                }
            }
            if constexpr (Selection::OnPath::kMerges) {
                if (add_merges) merges(context, z, t, contribute);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= context.max_edges) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, contribute);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters, visit,
                          escape);
    }

    template <class Contribute>
    void merges(SampleContext& context, const PathVertex* z, int t, Contribute&& contribute) const {
        PathView view;
        const PathVertex& v = z[t - 1];
        const float scale = 1 / (float(pool->size()) * kPi * radius * radius);
        for (const std::vector<PathVertex>& y : *pool)
            for (int s = 2; s <= int(y.size()) && s + t - 2 <= context.max_edges; ++s) {
                const PathVertex& photon = y[size_t(s - 1)];
                if (length_squared(photon.p - v.p) > radius * radius || dot(photon.ng, v.ng) < 0.7f) continue;
                const Rgb c = merge(context.scene, y.data(), s, z, t, &view);
                if (c.is_black()) continue;
                contribute(
                    PathContribution{.value = c * scale, .technique = Technique::merge(s - 1), .t = t, .y = y.data(), .z = z},
                    view);
            }
    }
};

}  // namespace lightloom::testing
