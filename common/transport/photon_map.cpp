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
                    if (paths[m].length > 0) visit(part, paths[m], cache.at(paths[m].first_vertex));
        });
    };
    std::vector<uint32_t> next(parts, 0);
    in_parts([&](size_t part, const LightCache::Path& path, const LightVertex* y) {
        for_each_photon(y, path.length, [&](uint32_t) { ++next[part]; });
    });
    uint32_t count = 0;
    for (uint32_t& n : next) n = std::exchange(count, count + n);

    struct End {
        uint32_t first_vertex, s;
    };
    std::vector<Point, HugePageAllocator<Point>> points(count);
    std::vector<End, HugePageAllocator<End>> ends(count);
    in_parts([&](size_t part, const LightCache::Path& path, const LightVertex* y) {
        for_each_photon(y, path.length, [&](uint32_t s) {
            const uint32_t number = next[part]++;
            points[number] = {y[s - 1].p, number};
            ends[number] = {path.first_vertex, s};
        });
    });

    if (count > kLeaf) {
        // The halves differ by one photon at most, so that all leaves lie on two levels.
        size_t nodes = 1;
        for (uint32_t largest = count; largest > kLeaf; largest = (largest + 1) / 2) nodes = 2 * nodes + 1;
        nodes_.resize(nodes / 2);
        Bounds3 bounds;
        for (const Point& point : points) bounds.extend(point.p);
        build(points.data(), {0, 0, count}, bounds);
    }
    photons_.resize(count);
    fork_join(parts, [&](size_t first, size_t last) {
        const size_t share = (size_t(count) + parts - 1) / parts;
        for (size_t i = first * share; i < std::min<size_t>(count, last * share); ++i) {
            const End& end = ends[points[i].number];
            photons_[i] = {points[i].p, end.first_vertex, end.s};
        }
    });
}

void PhotonMap::build(Point* points, Range range, const Bounds3& bounds) {
    if (range.end - range.begin <= kLeaf) {
        std::sort(points + range.begin, points + range.end, [](const Point& a, const Point& b) { return a.number < b.number; });
        return;
    }
    const Vec3 extent = bounds.hi - bounds.lo;
    const uint32_t axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const uint32_t middle = range.middle();
    std::nth_element(points + range.begin, points + middle, points + range.end, [axis](const Point& a, const Point& b) {
        const float pa = a.p[int(axis)], pb = b.p[int(axis)];
        return pa < pb || (pa == pb && a.number < b.number);
    });
    const float split = points[middle].p[int(axis)];
    nodes_[range.node] = {split, axis};
    Bounds3 low = bounds, high = bounds;
    if (axis == 0) low.hi.x = high.lo.x = split;
    if (axis == 1) low.hi.y = high.lo.y = split;
    if (axis == 2) low.hi.z = high.lo.z = split;
    const Range halves[] = {{2 * range.node + 1, range.begin, middle}, {2 * range.node + 2, middle, range.end}};
    const auto both = [&](size_t first, size_t last) {
        for (size_t half = first; half < last; ++half) build(points, halves[half], half == 0 ? low : high);
    };
    constexpr uint32_t kWorthATask = 8192;
    if (range.end - range.begin > kWorthATask)
        fork_join(2, both);
    else
        both(0, 2);
}

}  // namespace lightloom
