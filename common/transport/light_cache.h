#pragma once
// The light-vertex cache of a unit, or of each of its batches: light sub-paths traced before the first camera sample, frozen, and
// shared by all samples [Davidovic et al. 2014, section 4.1]. They belong to the batch: its key alone decides what they are.
//
// The plan counts the first work.light_path_count paths (N1 per pixel and iteration): they are connected to the lens (t
// = 1) and are candidates for connections. Where these are too few, or where rare subspaces keep a longer window,
// further paths are traced that are candidates only. The bytes do not depend on the number of threads: chunks are fixed
// and joined in order.

#include <memory>
#include <utility>
#include <vector>

#include "common/core/page_store.h"
#include "common/path/camera_walk.h"
#include "common/path/throughput.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

/// A prefix y_0 ... y_{s-1} that can be connected to a camera sub-path: y_0, or one that ends at a vertex with a smooth lobe; never
/// so long that no connection could take it.
struct LightPrefix {
    uint32_t first_vertex = 0;  ///< See LightCache::at().
    uint32_t path = 0;
    uint16_t s = 0;
    uint16_t label = kNoLabel;  ///< Label of y_{s-1}.
    float throughput = 0;       ///< Scalar of alpha of y_{s-1}.
};

/// The sub-paths of a unit. The addresses of vertices depend on the threads that traced them; everything else is in the
/// order of the paths, and no result may depend on anything but that order.
class LightCache {
    using Vertices = PageStore<LightVertex, kMaxEdges + 2>;
    using Surfaces = PageStore<LightSurface, 1>;

  public:
    struct Path {
        uint32_t first_vertex = 0, length = 0;
    };
    std::vector<Path> paths;
    std::vector<std::vector<LightPrefix>> prefixes;  ///< By chunk of paths; dropped once the method has made its index.

    uint64_t path_count() const { return paths.size(); }
    /// What the sub-paths take of memory, without `prefixes`.
    uint64_t memory_bytes() const { return vertices_.memory_bytes() + surfaces_.memory_bytes() + paths.capacity() * sizeof(Path); }
    /// y_0 of the path or prefix with this `first_vertex`; the others follow it.
    const LightVertex* at(uint32_t first_vertex) const { return vertices_.at(first_vertex); }
    template <class Visit>
    void for_each_prefix(Visit&& visit) const {
        for (const auto& chunk : prefixes)
            for (const LightPrefix& p : chunk) visit(p);
    }

    /// Appends the paths of one thread, one after the other. Several writers may be in use at a time.
    class Writer {
      public:
        explicit Writer(LightCache& cache) : vertices_(cache.vertices_), surfaces_(cache.surfaces_) {}
        Path append(const PathVertex* y, int n) {
            const auto run = vertices_.append(uint32_t(n));
            for (int i = 0; i < n; ++i) {
                const LightSurface* surface = nullptr;
                if (LightVertex::needs_surface(y[i])) surface = std::construct_at(surfaces_.append(1).data, y[i]);
                std::construct_at(run.data + i, y[i], surface);
            }
            return {run.first, uint32_t(n)};
        }

      private:
        Vertices::Writer vertices_;
        Surfaces::Writer surfaces_;
    };

  private:
    Vertices vertices_;
    Surfaces surfaces_;
};

inline constexpr int kMaxConnections = 64;

/// A draw from the cache. All draws of a camera vertex are made before its connections, so that their memory is already
/// being fetched.
struct LightPick {
    const LightVertex* y = nullptr;
    int s = 0;
    float scale = 0;  ///< Factor of the contribution, for the density of the draw.
};

/// A prefix that a draw may find, by its first vertex and length.
struct LightCandidate {
    uint32_t first_vertex = 0;
    uint32_t s = 0;
};

/// Traces `path_count` paths. `finish(y, n)` is called once a path is complete (labels), `splat(y, s, lens_sample, m, chunk)` for
/// every vertex of a counted path m that can be connected to the lens.
template <class Finish, class SplatVertex>
LightCache trace_light_cache(const UnitScope& scope, uint64_t path_count, UnitPreparation* preparation, Finish&& finish,
                             SplatVertex&& splat) {
    constexpr uint64_t kChunk = 256;
    struct Chunk {
        std::vector<Splat> splats;
        WalkCounters counters;
    };
    const RenderUnit& work = scope.work;
    LightCache cache;
    cache.paths.resize(path_count);
    std::vector<Chunk> chunks(size_t((path_count + kChunk - 1) / kChunk));
    cache.prefixes.resize(chunks.size());
    fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
        std::vector<PathVertex> y(size_t(scope.max_edges) + 2);
        LightCache::Writer writer(cache);
        for (size_t c = first_chunk; c != last_chunk && !scope.stop.stop_requested(); ++c) {
            Chunk& chunk = chunks[c];
            for (uint64_t m = c * kChunk; m < std::min(path_count, (c + 1) * kChunk); ++m) {
                const bool counted = m < work.light_path_count;
                // Uncounted paths are numbered within the unit, and its tile's first pixel is part of their keys: no
                // other unit of the group has the same keys.
                const uint64_t tile_key = uint64_t(scope.scene.frame().crop.index(work.owner().x0, work.owner().y0)) << 32;
                const RngKey key{scope.seed, counted ? Stage::kLight : Stage::kLightPool, work.group_first_iteration,
                                 counted ? work.first_light_path + m : tile_key | m};
                LightSampler sampler(key);
                const int n = trace_light_path(scope.scene, sampler, scope.max_edges, scope.roulette, y.data(), &chunk.counters);
                finish(y.data(), n);
                const LightCache::Path path = cache.paths[m] = writer.append(y.data(), n);
                for (int i = 0; i < n && i + 1 < scope.max_edges; ++i) {
                    const PathVertex& v = y[size_t(i)];
                    if (i > 0 && !v.bsdf.has_smooth_lobe()) continue;
                    cache.prefixes[c].push_back({path.first_vertex, uint32_t(m), uint16_t(i + 1), v.label, scalar_of(v.alpha)});
                }
                for (int s = 2; counted && s <= n; ++s)
                    if (y[size_t(s - 1)].bsdf.has_smooth_lobe()) splat(y.data(), s, sampler.rng().uniform2(), m, chunk);
            }
        }
    });
    for (Chunk& chunk : chunks) {
        preparation->splats.push_back(std::move(chunk.splats));
        preparation->counters.rays += chunk.counters.rays;
        preparation->counters.vertices += chunk.counters.vertices;
        preparation->counters.connections += chunk.counters.connections;
    }
    preparation->light_paths = path_count;
    return cache;
}

/// Connects z_{t-1} to the end of a prefix: s = 1 to the point x_0 itself, s >= 2 to y_{s-1}. Returns the unweighted
/// contribution f / p, where p is the prefix's density as traced; black when the connection fails. The view describes
/// the path and, for s = 1, how next event estimation would have chosen x_0.
template <ViewDetail detail, class Vertex>
Rgb connect_candidate(const Scene& scene, const Vertex* y, int s, const PathVertex* z, int t, PathView* view,
                      WalkCounters* counters) {
    if (s >= 2) return connect<detail>(scene, y, s, z, t, view, counters);
    NextEventSample light;
    light.emitter = uint32_t(y[0].emitter);
    if (!scene.emitters().connect_point(z[t - 1].p, y[0].p, y[0].ng, &light)) return {};
    light.pdf = float(y[0].fwd);
    const Rgb contribution = next_event<detail>(scene, z, t, light, view, counters);
    if (contribution.is_black()) return {};
    const EmitterSet& emitters = scene.emitters();
    view->next_event = emitters.pdf_next_event(emitters[light.emitter], z[t - 1].p, light.position, light.normal, light.wi);
    return contribution;
}

}  // namespace lightloom
