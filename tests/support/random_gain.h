#pragma once
// Gain tables without any knowledge: random places, gains and brightness. No image's mean may depend on them.

#include <cmath>

#include "common/core/rng.h"
#include "common/tables/gain_table.h"

namespace lightloom::testing {

/// A valid table of a frame with this crop, for a scene within 1.2 of the y axis, between 0 and 2 above the origin; some places
/// end nine sub-paths of ten, some divide most of them.
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
            const float u = 2 * rng.uniform() - 1;
            data.nodes[i] = GainData::make_inner(axis, axis >= 3 ? 0.5f * u : axis == 1 ? 1 + u : 1.2f * u, left);
            data.nodes.resize(data.nodes.size() + 2);
        } else {
            data.nodes[i] = GainData::make_leaf(uint32_t(data.gains.size()));
            const float gain = std::exp(5 * rng.uniform() - 2);
            data.gains.push_back({gain, gain * (0.3f + 0.7f * rng.uniform())});
        }
    }
    return data;
}

}  // namespace lightloom::testing
