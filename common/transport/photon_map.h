#pragma once
// PhotonMap: the vertices of an iteration's light sub-paths, found by place. Radii differ from one camera sub-path to the next and
// from place to place, so that it is a balanced k-d tree over the points and not a grid: a query costs as much as it has
// neighbours, whatever its radius.
//
// What a query finds, and in which order, is a function of the photons alone: each split parts its photons by position and, where
// positions are equal, by number, and a leaf has them in the order of their numbers.

#include <cstdint>
#include <iterator>
#include <vector>

#include "common/transport/light_cache.h"

namespace lightloom {

class PhotonMap {
  public:
    PhotonMap() = default;
    /// Holds every vertex but y_0 of the cache's paths that can be merged (LightVertex::smooth). The cache must outlive the map.
    explicit PhotonMap(const LightCache& cache);

    size_t size() const { return photons_.size(); }
    uint64_t memory_bytes() const { return photons_.capacity() * sizeof(Photon) + nodes_.capacity() * sizeof(Node); }

    struct Photon {
        Vec3 p;
        /// Where a sub-path's first s vertices lie in the cache, see LightCache::at(); the photon is the last of them.
        uint32_t first_vertex = 0, s = 0;
    };

    /// Calls visit(photon, distance2) for every photon closer to `p` than the radius, whose square is `radius2`.
    template <class Visit>
    LL_ALWAYS_INLINE inline void for_each_near(const Vec3& p, float radius2, Visit&& visit) const {
        if (photons_.empty()) return;
        // Leaves are far apart in memory, and so several are asked for before the first is read.
        Range stack[kMostLevels], leaves[8];
        int depth = 0;
        size_t found = 0;
        const auto read = [&] {
            for (size_t leaf = 0; leaf < found; ++leaf)
                for (uint32_t i = leaves[leaf].begin; i < leaves[leaf].end; ++i) {
                    const float distance2 = length_squared(photons_[i].p - p);
                    if (distance2 < radius2) visit(photons_[i], distance2);
                }
            found = 0;
        };
        Range range{0, 0, uint32_t(photons_.size())};
        while (true) {
            while (range.end - range.begin > kLeaf) {
                const Node node = nodes_[range.node];
                const float beyond = p[int(node.axis)] - node.split;
                const uint32_t middle = range.middle();
                const Range low{2 * range.node + 1, range.begin, middle}, high{2 * range.node + 2, middle, range.end};
                const bool below = beyond < 0;
                if (beyond * beyond < radius2) stack[depth++] = below ? high : low;
                range = below ? low : high;
            }
            for (uint32_t i = range.begin; i < range.end; i += 3) __builtin_prefetch(&photons_[i]);  // 64 bytes have three
            leaves[found++] = range;
            if (found == std::size(leaves)) read();
            if (depth == 0) break;
            range = stack[--depth];
        }
        read();
    }

  private:
    static constexpr uint32_t kLeaf = 16;
    static constexpr int kMostLevels = 32;

    struct Node {
        float split = 0;
        uint32_t axis = 0;
    };

  public:
    /// memory_bytes() of a large map, for each of its photons, at most: leaves may be half full.
    static constexpr double kBytesPerPhoton = sizeof(Photon) + 2.0 * sizeof(Node) / kLeaf;

  private:
    /// The photons of a node: its children have the halves.
    struct Range {
        uint32_t node, begin, end;
        uint32_t middle() const { return begin + (end - begin) / 2; }
    };

    /// Orders photons whose `first_vertex` is the number of their path for the time being.
    void build(Range range, const Bounds3& bounds);

    std::vector<Photon, HugePageAllocator<Photon>> photons_;
    std::vector<Node> nodes_;  ///< A heap: the children of node i are 2 i + 1 and 2 i + 2.
};

}  // namespace lightloom
