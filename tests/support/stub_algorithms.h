#pragma once
// Stand-ins for methods to come, made of production pieces only: they show that pairing over the
// whole frame and merging need no change of the core. Slow on purpose (every photon is looked at);
// never part of the product.

#include "tests/support/estimates.h"

namespace lightloom::testing {

/// Vertex merging with a fixed radius on top of classic connections [Georgiev et al. 2012].
struct MergeStubSelection {
    static constexpr bool kMerges = true;
    BdptSelection connections;
    double light_paths = 4096, radius = 0.02;

    int s_min(int k) const { return connections.s_min(k); }
    int s_max(int k) const { return connections.s_max(k); }
    double connect_factor(const PathView& view, int s) const { return connections.connect_factor(view, s); }
    double merge_factor(const PathView&, int) const { return light_paths * kPiD * radius * radius; }
};

/// Pairs every camera sub-path with `pairs` light sub-paths chosen over the whole frame (matrix
/// BDPT's shape): each light path is equally likely, so sigma of a connection is the number of
/// pairs.
struct PairingStubSelection {
    static constexpr bool kMerges = false;
    BdptSelection connections;
    double pairs = 4;

    int s_min(int k) const { return connections.s_min(k); }
    int s_max(int k) const { return connections.s_max(k); }
    double connect_factor(const PathView& view, int s) const {
        return connections.connect_factor(view, s) * (s >= 2 && s < view.k ? pairs : 1);
    }
};

/// Light sub-paths of a whole frame, each as long as it went.
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

/// The merge of y_{s-1} with z_{t-1}: the unweighted contribution divided by the kernel 1 / (pi
/// r^2), and the path's view.
inline Rgb merge(const Scene& scene, const PathVertex* y, int s, const PathVertex* z, int t, PathView* view) {
    const PathVertex &a = y[s - 1], &b = z[t - 1];
    const BsdfEval e = b.bsdf.eval(b.wo_local, b.shading.to_local(a.wo), TransportMode::kRadiance);
    const Rgb contribution = b.alpha * e.f * a.alpha;
    if (contribution.is_black()) return {};
    const int i = s - 1, k = s + t - 2;
    view->k = k;
    view_light_prefix(y, s, view);
    view_camera_suffix(z, t, k, view);
    view->delta[i] = false;
    view->fwd[i] = a.fwd;
    view->rev[i] = b.fwd;
    view->rev[i - 1] = double(e.pdf_fwd) * a.to_previous;
    if (t >= 3) view->fwd[i + 1] = double(e.pdf_rev) * b.to_previous;
    const Emitter& emitter = scene.emitters()[uint32_t(y[0].emitter)];
    view->next_event = scene.emitters().pdf_next_event(emitter, y[1].p, y[0].p, y[0].ng, y[1].wo);
    return contribution;
}

/// bdpt whose light vertices come from a pool: `pairs` of its paths are connected, and with a
/// radius all vertices merged.
template <class Selection>
struct PoolAlgorithm {
    Selection selection;
    const LightPool* pool;
    int pairs = 1;
    float radius = 0;        ///< 0: no merges.
    bool add_merges = true;  ///< False: they keep their share of the weights, but their light is left out.

    Rgb sample(SampleContext& context) const {
        const Scene& scene = context.scene;
        PathVertex *own = context.light_path_vertices, *z = context.camera_path;
        PathView view;
        const auto connected = [&](const Rgb& contribution, int s) {
            return contribution * float(mis_weight(view, {TechniqueKind::kConnect, s}, selection));
        };
        LightSampler light_sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(scene, light_sampler, context.max_edges, context.roulette, own, &context.counters);
        for (int s = 2; s <= n; ++s) {
            if (!own[s - 1].bsdf.has_smooth_lobe()) continue;
            Vec2 film;
            const Vec3 lens = scene.camera().sample_lens(light_sampler.rng().uniform2());
            const Rgb c = connect_to_camera(scene, own, s, lens, &film, &view, &context.counters);
            if (!c.is_black()) context.splat(film, connected(c, s));
        }

        Rgb sum;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        Rng choice({context.seed, Stage::kPairing, context.iteration, context.pixel});
        const auto visit = [&](int t) {
            const PathVertex& v = z[t - 1];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit(scene, z, t, &view); !c.is_black()) sum += connected(c, 0);
            if (t > context.max_edges || !v.bsdf.has_smooth_lobe()) return;
            NextEventSample light;
            const double pick = sampler.rng().uniform_double();
            if (scene.emitters().sample_next_event(v.p, pick, sampler.next_event(t), &light))
                if (const Rgb c = next_event(scene, z, t, light, &view, &context.counters); !c.is_black()) sum += connected(c, 1);
            for (int q = 0; q < pairs; ++q) {
                const std::vector<PathVertex>& y = (*pool)[choice.below(uint32_t(pool->size()))];
                for (int s = 2; s <= int(y.size()) && s + t - 1 <= context.max_edges; ++s) {
                    if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                    const Rgb c = connect(scene, y.data(), s, z, t, &view, &context.counters);
                    if (!c.is_black()) sum += connected(c, s) / float(pairs);
                }
            }
            if constexpr (Selection::kMerges) {
                if (add_merges) sum += merges(context, z, t);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t > context.max_edges) return;
            if (const Rgb c = environment_hit(scene, z, t, ray, &view); !c.is_black()) sum += connected(c, 0);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters, visit,
                          escape);
        return sum;
    }

    Rgb merges(SampleContext& context, const PathVertex* z, int t) const {
        PathView view;
        Rgb sum;
        const PathVertex& v = z[t - 1];
        for (const std::vector<PathVertex>& y : *pool)
            for (int s = 2; s <= int(y.size()) && s + t - 2 <= context.max_edges; ++s) {
                const PathVertex& photon = y[size_t(s - 1)];
                if (length_squared(photon.p - v.p) > radius * radius || dot(photon.ng, v.ng) < 0.7f) continue;
                const Rgb c = merge(context.scene, y.data(), s, z, t, &view);
                if (!c.is_black()) sum += c * float(mis_weight(view, {TechniqueKind::kMerge, s - 1}, selection));
            }
        return sum / (float(pool->size()) * kPi * radius * radius);
    }
};

}  // namespace lightloom::testing
