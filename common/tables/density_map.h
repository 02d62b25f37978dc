#pragma once
// DensityMap: how many photons lie around a place, on average over many light sub-paths. It is learned before the render, frozen,
// and read by weights alone [Jendersie and Grosch 2018, section 5.1; common/path/README.md, "Merging"].
//
// An octree over positions. Where photons are many its cells are small; a place's density is that of the smallest cell around it
// that holds enough of them, over the area of a face of the cell, as if one flat surface passed through it.

#include <cstdint>
#include <utility>
#include <vector>

#include "common/core/result.h"
#include "common/core/vec.h"

namespace lightloom {

/// What was learned, as plain arrays.
struct DensityData {
    static constexpr uint32_t kLeaf = 0x80000000u;
    static constexpr size_t kMaxDensities = 0xffff;  ///< A label is 16 bits, and 0xffff is none.

    Vec3 corner;                   ///< The least of the root cell.
    float side = 0;                ///< Of the root cell, m; positive.
    std::vector<uint32_t> nodes;   ///< The first is the root. kLeaf | label, or where the eight children begin: after the node.
    std::vector<float> densities;  ///< By label: photons per light sub-path and square metre; positive.

    /// Checks everything that reading relies on; kDataLoss names what is wrong.
    Status validate() const;
    /// Whether there is anything; without, no disc is taken to hold more than one photon.
    bool learned() const { return !nodes.empty(); }
};

class DensityMap {
  public:
    /// The data must be valid and learned.
    explicit DensityMap(DensityData data) : data_(std::move(data)) {}

    const DensityData& data() const { return data_; }
    /// Of the cell that decides the density at `p`, which may lie outside of the root.
    uint16_t label(const Vec3& p) const {
        float half = data_.side / 2;
        Vec3 middle = data_.corner + Vec3{half, half, half};
        uint32_t node = data_.nodes[0];
        while (!(node & DensityData::kLeaf)) {
            const uint32_t x = p.x >= middle.x, y = p.y >= middle.y, z = p.z >= middle.z;
            half /= 2;
            middle = middle + Vec3{x ? half : -half, y ? half : -half, z ? half : -half};
            node = data_.nodes[node + (x | y << 1 | z << 2)];
        }
        return uint16_t(node & ~DensityData::kLeaf);
    }
    /// Photons per light sub-path and square metre.
    float density(uint16_t label) const { return data_.densities[label]; }

  private:
    DensityData data_;
};

}  // namespace lightloom
