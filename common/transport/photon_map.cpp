#include "common/transport/photon_map.h"

#include <algorithm>

namespace lightloom {
namespace {

constexpr size_t kPathsPerPart = 4096;

/// Calls visit(s) for the sub-path's vertices that can be merged.
template <class Visit>
void for_each_photon(const LightVertex* y, uint32_t length, Visit&& visit) {
    for (uint32_t s = 2; s <= length; ++s)
        if (y[s - 1].smooth) visit(s);
}

}  // namespace

PhotonMap::PhotonMap(const LightCache& cache) {
    const std::vector<LightCache::Path>& paths = cache.paths;
    const size_t parts = (paths.size() + kPathsPerPart - 1) / kPathsPerPart;
    const auto in_parts = [&](const auto& visit) {
        fork_join(parts, [&](size_t first, size_t last) {
            for (size_t part = first; part < last; ++part)
                for (size_t m = part * kPathsPerPart; m < std::min(paths.size(), (part + 1) * kPathsPerPart); ++m)
                    if (paths[m].length > 0) visit(part, uint32_t(m), cache.at(paths[m].first_vertex));
        });
    };
    std::vector<uint32_t> next(parts, 0);
    in_parts([&](size_t part, uint32_t m, const LightVertex* y) {
        for_each_photon(y, paths[m].length, [&](uint32_t) { ++next[part]; });
    });
    uint32_t count = 0;
    for (uint32_t& n : next) n = std::exchange(count, count + n);
    // Addresses depend on threads, numbers of paths do not.
    photons_.resize(count);
    in_parts([&](size_t part, uint32_t m, const LightVertex* y) {
        for_each_photon(y, paths[m].length, [&](uint32_t s) { photons_[next[part]++] = {y[s - 1].p, m, s}; });
    });
    if (count > kLeaf) {
        // The halves differ by one photon at most, so that all leaves lie on two levels.
        size_t nodes = 1;
        for (uint32_t largest = count; largest > kLeaf; largest = (largest + 1) / 2) nodes = 2 * nodes + 1;
        nodes_.resize(nodes / 2);
        Bounds3 bounds;
        for (const Photon& photon : photons_) bounds.extend(photon.p);
        build({0, 0, count}, bounds);
    }
    fork_join(photons_.size(), [&](size_t first, size_t last) {
        for (size_t i = first; i < last; ++i) photons_[i].first_vertex = paths[photons_[i].first_vertex].first_vertex;
    });
}

void PhotonMap::build(Range range, const Bounds3& bounds) {
    const auto earlier = [](const Photon& a, const Photon& b) {
        return a.first_vertex < b.first_vertex || (a.first_vertex == b.first_vertex && a.s < b.s);
    };
    Photon* photons = photons_.data();
    if (range.end - range.begin <= kLeaf) {
        std::sort(photons + range.begin, photons + range.end, earlier);
        return;
    }
    const Vec3 extent = bounds.hi - bounds.lo;
    const uint32_t axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const uint32_t middle = range.middle();
    std::nth_element(photons + range.begin, photons + middle, photons + range.end, [&](const Photon& a, const Photon& b) {
        const float pa = a.p[int(axis)], pb = b.p[int(axis)];
        return pa < pb || (pa == pb && earlier(a, b));
    });
    const float split = photons[middle].p[int(axis)];
    nodes_[range.node] = {split, axis};
    Bounds3 low = bounds, high = bounds;
    if (axis == 0) low.hi.x = high.lo.x = split;
    if (axis == 1) low.hi.y = high.lo.y = split;
    if (axis == 2) low.hi.z = high.lo.z = split;
    const Range halves[] = {{2 * range.node + 1, range.begin, middle}, {2 * range.node + 2, middle, range.end}};
    const auto both = [&](size_t first, size_t last) {
        for (size_t half = first; half < last; ++half) build(halves[half], half == 0 ? low : high);
    };
    constexpr uint32_t kWorthATask = 8192;
    if (range.end - range.begin > kWorthATask)
        fork_join(2, both);
    else
        both(0, 2);
}

}  // namespace lightloom
