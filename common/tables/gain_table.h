#pragma once
// What the rest of a camera sub-path still has to gain, by the place that the sub-path has reached: learned before the
// render, frozen, and read by Russian roulette. [Adjoint-driven roulette and splitting: Vorba and Křivánek 2016; gain
// over cost: Rath et al. 2022; common/path/README.md, "Russian roulette"]

#include <cstdint>
#include <utility>
#include <vector>

#include "common/core/math.h"
#include "common/core/result.h"
#include "common/core/vec.h"
#include "common/tables/frame_blocks.h"

namespace lightloom {

/// What was learned, as plain arrays.
struct GainData {
    /// A decision tree over places. Inner nodes: an axis (0, 1, 2: position in world space; 3, 4, 5: geometric
    /// normal on the side from which the sub-path came)
    /// and the left child, which the right one follows; leaves: axis 7 and the number of a gain.
    struct Node {
        float threshold = 0;
        uint32_t axis_and_child = 7u << 29;
        uint32_t axis() const { return axis_and_child >> 29; }
        uint32_t child() const { return axis_and_child & 0x1fffffffu; }
    };
    static Node make_leaf(uint32_t gain) { return {0, 7u << 29 | gain}; }
    static Node make_inner(uint32_t axis, float threshold, uint32_t left) { return {threshold, axis << 29 | left}; }

    /// How many sub-paths should go on from here for each unit of (throughput / brightness of the pixel's block), if cost is to
    /// buy as much as elsewhere. `keep` rather too many, because what was never found may be there all the same, and
    /// `split` rather too few, because a few lucky paths prove little.
    struct Gain {
        float keep = 0, split = 0;
    };

    int32_t blocks_x = 0, blocks_y = 0;
    std::vector<float> brightness;  ///< Of every block of the frame (FrameBlocks), scalar_of() of radiance; positive.
    std::vector<Node> nodes;
    std::vector<Gain> gains;

    /// Checks everything that reading relies on; kDataLoss names what is wrong.
    Status validate() const;
    /// Whether there is anything; without, roulette goes by throughput alone.
    bool learned() const { return !nodes.empty(); }
};

class GainTable {
  public:
    /// Between these numbers of sub-paths one goes on, because both roulette and splitting have their price (the weight window of
    /// Vorba and Křivánek 2016).
    static constexpr float kFewest = 0.5f, kMany = 2;
    /// No event leaves fewer sub-paths, which bounds what a wrong table can cost, nor makes more.
    static constexpr float kLeast = 0.1f, kMost = 16;

    /// The data must be valid, learned, and of a frame with this crop.
    GainTable(GainData data, const Rect& crop) : data_(std::move(data)), blocks_(crop) {}

    const GainData& data() const { return data_; }
    /// Brightness of the block of a pixel of the crop.
    float brightness(int px, int py) const { return data_.brightness[blocks_.at(px, py)]; }
    const GainData::Gain& at(const Vec3& p, const Vec3& normal) const {
        const float place[6] = {p.x, p.y, p.z, normal.x, normal.y, normal.z};
        uint32_t i = 0;
        for (uint32_t axis = data_.nodes[0].axis(); axis < 6; axis = data_.nodes[i].axis())
            i = data_.nodes[i].child() + (place[axis] >= data_.nodes[i].threshold ? 1 : 0);
        return data_.gains[data_.nodes[i].child()];
    }
    /// The number of sub-paths, in expectation, that go on from a place, given throughput over brightness.
    static float continuations(const GainData::Gain& gain, float relative_throughput) {
        const float keep = gain.keep * relative_throughput, split = gain.split * relative_throughput;
        if (keep < kFewest) return std::max(keep * (1 / kFewest), kLeast);
        if (split > kMany) return std::min(split * (1 / kMany), kMost);
        return 1;
    }

  private:
    GainData data_;
    FrameBlocks blocks_;
};

}  // namespace lightloom
