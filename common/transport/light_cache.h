#pragma once
// The light-vertex cache of a unit: light sub-paths traced before its first camera sample, frozen, and shared by all of its
// samples [Davidovic et al. 2014, section 4.1]. The unit owns them: nothing outside its key decides what they are.
//
// The first work.light_path_count paths are those that the plan counts (N1 per pixel and iteration): they are connected to the
// lens (t = 1) and they are candidates. Further ones, where that would be too few or where rare subspaces keep a longer
// window, are candidates only. The bytes do not depend on the number of threads: chunks are fixed and joined in order.

#include <vector>

#include "common/core/huge_pages.h"
#include "common/path/camera_walk.h"
#include "common/path/throughput.h"
#include "common/transport/unit_loop.h"

namespace lightloom {

struct LightCache {
    std::vector<PathVertex, HugePageAllocator<PathVertex>> vertices;  ///< Path after path.
    std::vector<uint32_t> first_vertex;                               ///< Of every path; one more at the end.
    uint64_t path_count() const { return first_vertex.size() - 1; }
};

inline constexpr int kMaxConnections = 64;

/// A draw from the cache, made before the connections of a vertex so that their memory is on its way.
struct LightPick {
    const PathVertex* y = nullptr;
    int s = 0;
    float scale = 0;  ///< Of the contribution: one over what was really drawn.
};

/// A prefix y_0 ... y_{s-1} that can be connected.
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
        std::vector<PathVertex> vertices;
        std::vector<uint32_t> lengths;
        std::vector<Splat> splats;
        WalkCounters counters;
    };
    const UnitWork& work = scope.work;
    std::vector<Chunk> chunks(size_t((path_count + kChunk - 1) / kChunk));
    fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
        std::vector<PathVertex> y(size_t(scope.max_edges) + 2);
        for (size_t c = first_chunk; c != last_chunk && !scope.stop.stop_requested(); ++c) {
            Chunk& chunk = chunks[c];
            for (uint64_t m = c * kChunk; m < std::min(path_count, (c + 1) * kChunk); ++m) {
                const bool counted = m < work.light_path_count;
                // The others are numbered within the unit, under its tile's first pixel: no other unit of the group has
                // those keys.
                const uint64_t tile_key = uint64_t(scope.scene.frame().crop.index(work.owner().x0, work.owner().y0)) << 32;
                const RngKey key{scope.seed, counted ? Stage::kLight : Stage::kLightPool, work.group_first_iteration,
                                 counted ? work.first_light_path + m : tile_key | m};
                LightSampler sampler(key);
                const int n = trace_light_path(scope.scene, sampler, scope.max_edges, scope.roulette, y.data(), &chunk.counters);
                finish(y.data(), n);
                chunk.lengths.push_back(uint32_t(n));
                chunk.vertices.insert(chunk.vertices.end(), y.begin(), y.begin() + n);
                for (int s = 2; counted && s <= n; ++s)
                    if (y[size_t(s - 1)].bsdf.has_smooth_lobe()) splat(y.data(), s, sampler.rng().uniform2(), m, chunk);
            }
        }
    });
    LightCache cache;
    cache.first_vertex.push_back(0);
    size_t total = 0;
    for (const Chunk& chunk : chunks) total += chunk.vertices.size();
    cache.vertices.reserve(total);
    for (Chunk& chunk : chunks) {
        cache.vertices.insert(cache.vertices.end(), chunk.vertices.begin(), chunk.vertices.end());
        for (const uint32_t n : chunk.lengths) cache.first_vertex.push_back(cache.first_vertex.back() + n);
        chunk.vertices = {};
        preparation->splats.push_back(std::move(chunk.splats));
        preparation->counters.rays += chunk.counters.rays;
        preparation->counters.vertices += chunk.counters.vertices;
        preparation->counters.connections += chunk.counters.connections;
    }
    preparation->light_paths = path_count;
    return cache;
}

/// Calls visit(candidate, vertex) for every prefix that can be connected to a camera sub-path: y_0 and the vertices with a
/// smooth lobe. A prefix of max_edges vertices is too long for any connection.
template <class Visit>
void for_each_candidate(const LightCache& cache, uint64_t path, int max_edges, Visit&& visit) {
    const uint32_t first = cache.first_vertex[path], n = cache.first_vertex[path + 1] - first;
    for (uint32_t i = 0; i < n && int(i) + 1 < max_edges; ++i) {
        const PathVertex& v = cache.vertices[first + i];
        if (i == 0 || v.bsdf.has_smooth_lobe()) visit(LightCandidate{first, i + 1}, v);
    }
}

/// Connects z_{t-1} to the end of a prefix: s = 1 to the point x_0 itself, s >= 2 to y_{s-1}. Unweighted contribution f / p with
/// the prefix's density as traced, p(y); black when it fails.
template <ViewDetail detail>
Rgb connect_candidate(const Scene& scene, const PathVertex* y, int s, const PathVertex* z, int t, PathView* view,
                      WalkCounters* counters) {
    if (s >= 2) return connect<detail>(scene, y, s, z, t, view, counters);
    NextEventSample light;
    light.emitter = uint32_t(y[0].emitter);
    if (!scene.emitters().connect_point(z[t - 1].p, y[0].p, y[0].ng, &light)) return {};
    light.pdf = float(y[0].fwd);
    return next_event<detail>(scene, z, t, light, view, counters);
}

}  // namespace lightloom
