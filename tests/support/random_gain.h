#pragma once
// Gain tables without any knowledge: random places, gains and brightness. No image's mean may depend on them.

#include <cmath>

#include "common/core/rng.h"
#include "common/tables/gain_table.h"

namespace lightloom::testing {

/// A valid table of a frame with this crop, for a scene that lies within 2 of the origin; some places end nine sub-paths of
/// ten, some divide most of them.
inline GainData random_gain(const Rect& crop, uint64_t seed) {
    Rng rng({seed, Stage::kTraining, 79, 0});
    const FrameBlocks blocks(crop);
    GainData data;
    data.blocks_x = blocks.columns(), data.blocks_y = blocks.rows();
    for (int b = 0; b < data.blocks_x * data.blocks_y; ++b) data.brightness.push_back(std::exp(rng.uniform() - 0.5f));
    data.nodes.resize(1);
    for (uint32_t i = 0; i < data.nodes.size(); ++i) {
        if (data.nodes.size() < 40) {
            const uint32_t left = uint32_t(data.nodes.size()), axis = rng.below(6);
            data.nodes[i] = GainData::make_inner(axis, (axis < 3 ? 4 : 2) * rng.uniform() - (axis < 3 ? 2 : 1), left);
            data.nodes.resize(data.nodes.size() + 2);
        } else {
            data.nodes[i] = GainData::make_leaf(uint32_t(data.gains.size()));
            const float gain = std::exp(6 * rng.uniform() - 3);
            data.gains.push_back({gain, gain * rng.uniform()});
        }
    }
    return data;
}

}  // namespace lightloom::testing
