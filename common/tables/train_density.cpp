#include "common/tables/train_density.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lightloom {
namespace {

/// Beyond this depth cells are smaller than what positions resolve.
constexpr int kMostLevels = 20;
/// Cells of this share of the photons are small enough, however many there are.
constexpr size_t kFinest = 8192;

/// A node that is still to be divided or left as a leaf.
struct Pending {
    size_t begin, end;  ///< Its photons.
    size_t node;
    uint32_t label;  ///< Of the smallest cell around it that holds enough photons, or its own.
    Vec3 middle;
    float half;
};

uint32_t octant(const Vec3& p, const Vec3& middle) {
    return uint32_t(p.x >= middle.x) | uint32_t(p.y >= middle.y) << 1 | uint32_t(p.z >= middle.z) << 2;
}

}  // namespace

DensityData build_density_map(std::span<const Vec3> photons, uint64_t light_paths) {
    DensityData map;
    if (photons.empty() || light_paths == 0) return map;
    Bounds3 bounds;
    for (const Vec3& p : photons) bounds.extend(p);
    const Vec3 extent = bounds.hi - bounds.lo;
    map.corner = bounds.lo;
    // Photons that all lie in one place have no area; any positive one leaves their number right for discs of its size.
    map.side = std::max({extent.x, extent.y, extent.z, 1e-6f * std::max(1.0f, length(bounds.hi)), 1e-18f});

    const auto add_density = [&](size_t count, float side) {
        map.densities.push_back(float(double(std::max<size_t>(count, 1)) / (double(light_paths) * double(side) * double(side))));
        return uint32_t(map.densities.size() - 1);
    };
    const size_t most = std::max<size_t>(kMostCellPhotons, photons.size() / kFinest);
    std::vector<Vec3> sorted(photons.begin(), photons.end()), scratch(photons.size());
    map.nodes.push_back(0);
    const float half = map.side / 2;
    std::vector<Pending> level{
        {0, sorted.size(), 0, add_density(sorted.size(), map.side), map.corner + Vec3{half, half, half}, half}};
    // Level by level, so that whatever ends the division leaves cells of about the same size everywhere.
    for (int depth = 0; !level.empty(); ++depth) {
        std::vector<Pending> next;
        for (const Pending& cell : level) {
            if (cell.end - cell.begin <= most || depth == kMostLevels || map.densities.size() + 8 > DensityData::kMaxDensities) {
                map.nodes[cell.node] = DensityData::kLeaf | cell.label;
                continue;
            }
            std::array<size_t, 9> ends{};
            for (size_t i = cell.begin; i < cell.end; ++i) ++ends[octant(sorted[i], cell.middle) + 1];
            ends[0] = cell.begin;
            for (size_t o = 1; o <= 8; ++o) ends[o] += ends[o - 1];
            std::array<size_t, 8> at;
            std::copy_n(ends.begin(), 8, at.begin());
            for (size_t i = cell.begin; i < cell.end; ++i) scratch[at[octant(sorted[i], cell.middle)]++] = sorted[i];
            std::copy(scratch.begin() + ptrdiff_t(cell.begin), scratch.begin() + ptrdiff_t(cell.end),
                      sorted.begin() + ptrdiff_t(cell.begin));
            const size_t first = map.nodes.size();
            map.nodes[cell.node] = uint32_t(first);
            map.nodes.resize(first + 8);
            const float quarter = cell.half / 2;
            for (size_t o = 0; o < 8; ++o) {
                const size_t count = ends[o + 1] - ends[o];
                const Vec3 towards{o & 1 ? quarter : -quarter, o & 2 ? quarter : -quarter, o & 4 ? quarter : -quarter};
                next.push_back({ends[o], ends[o + 1], first + o,
                                count >= kLeastCellPhotons ? add_density(count, cell.half) : cell.label, cell.middle + towards,
                                quarter});
            }
        }
        level = std::move(next);
    }
    return map;
}

DensityData train_density(const TrainingData& data) {
    std::vector<Vec3> photons;
    for (const TrainingPath& path : data.light_paths)
        for (uint32_t i = 1; i < path.vertex_count; ++i)
            if (const TrainingVertex& v = data.vertices[path.first_vertex + i]; v.density > 0) photons.push_back(v.position);
    return build_density_map(photons, data.light_samples);
}

}  // namespace lightloom
