#include "common/transport/photon_memory.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "common/path/light_walk.h"
#include "common/transport/parameters.h"
#include "common/transport/photon_map.h"

namespace lightloom {
namespace {

std::mutex most_mutex;
PhotonMemory most;

std::string gigabytes(uint64_t bytes) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f GB", double(bytes) * 1e-9);
    return text;
}

}  // namespace

void note_photon_memory(const PhotonMemory& memory) {
    const std::lock_guard lock(most_mutex);
    if (memory.total() > most.total()) most = memory;
}

PhotonMemory most_photon_memory() {
    const std::lock_guard lock(most_mutex);
    return most;
}

PhotonMemory expected_photon_memory(const RendererRequest& request, uint64_t path_count) {
    constexpr uint64_t kProbes = 512;
    const Scene& scene = *request.scene;
    const int max_edges = request.settings.max_edges();
    const RouletteRule roulette = roulette_of(request.settings.algorithm);
    std::vector<PathVertex> y(size_t(max_edges) + 2);
    uint64_t vertices = 0, surfaces = 0, photons = 0;
    WalkCounters counters;
    for (uint64_t m = 0; m < kProbes; ++m) {
        // No image depends on these sub-paths, so that their numbers may be those of any others.
        LightSampler sampler({request.settings.seed, Stage::kLightPool, 0, m});
        const int n = trace_light_path(scene, sampler, max_edges, roulette, y.data(), &counters);
        vertices += uint64_t(n);
        for (int i = 1; i < n; ++i) {
            surfaces += LightVertex::needs_surface(y[size_t(i)]);
            photons += y[size_t(i)].bsdf.has_smooth_lobe();
        }
    }
    const double paths = double(path_count), share = paths / double(kProbes);
    // The list of prefixes that can be connected is there until the map is made; a vector that grows may hold twice its contents.
    const double prefixes = 2 * double(vertices) * sizeof(LightPrefix);
    return {uint64_t(paths * sizeof(LightCache::Path) +
                     share * (double(vertices) * sizeof(LightVertex) + double(surfaces) * sizeof(LightSurface) + prefixes)),
            uint64_t(share * double(photons) * PhotonMap::kBytesPerPhoton)};
}

Status check_photon_memory(const RendererRequest& request, uint64_t path_count, uint64_t machine_bytes) {
    const PhotonMemory need = expected_photon_memory(request, path_count);
    if (need.total() <= machine_bytes) return {};
    return {StatusCode::kResourceExhausted, "the " + std::to_string(path_count) + " light sub-paths of an iteration need about " +
                                                gigabytes(need.total()) + " of memory as photons; this machine has " +
                                                gigabytes(machine_bytes) + ": lower light-paths, cache or the resolution"};
}

}  // namespace lightloom
