#pragma once
// RenderUnit: the part of the image that one call of a renderer makes. Plain data that the plan, transport and tests
// share.

#include <algorithm>
#include <cstdint>

#include "common/film/frame.h"

namespace lightloom {

struct RenderUnit {
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;  ///< Iterations; camera samples per pixel of the tile, unless the unit only splats.
    /// First iteration of the whole group (and then of the batch), which is part of the keys of its light paths. It differs
    /// from first_iteration only when a part of a batch is rendered again (replay).
    uint64_t group_first_iteration = 0;
    Rect tile;
    /// Light paths that this unit traces and splats. `first_light_path` numbers them within the group.
    uint64_t first_light_path = 0;
    uint64_t light_path_count = 0;
    /// The whole unit's tile where `tile` is a part of it (replay of one sample); it is part of the keys of the unit's
    /// light-vertex cache. Empty means `tile`.
    Rect owner_tile;
    bool splats_only = false;  ///< No camera samples: all light of the unit is in its splats.

    const Rect& owner() const { return owner_tile.empty() ? tile : owner_tile; }
    uint32_t samples_per_pixel() const { return splats_only ? 0 : iteration_count; }

    /// A unit is rendered in batches of consecutive iterations, each of which is what a unit of its own would be, in a group of its
    /// own. What an algorithm keeps for a whole unit (splats in path order, a cache of light sub-paths) it keeps for a batch, so
    /// that long units take no more memory than short ones. So many camera samples make a batch, or one iteration if that is more.
    static constexpr int64_t kBatchSamples = int64_t(1) << 18;
    /// Iterations of a batch; the last one may have fewer.
    uint32_t batch_iterations() const {
        return uint32_t(std::max<int64_t>(1, kBatchSamples / std::max<int64_t>(1, owner().area())));
    }
    /// The batch that begins `done` iterations after the unit does. The light paths are shared out among the batches in proportion
    /// to their iterations, with exact cumulative rounding.
    RenderUnit batch(uint32_t done) const {
        if (iteration_count <= batch_iterations()) return *this;
        const uint32_t count = std::min(batch_iterations(), iteration_count - done);
        const auto paths_before = [&](uint32_t iterations) {
            return uint64_t((unsigned __int128)(light_path_count)*iterations / iteration_count);
        };
        RenderUnit out = *this;
        out.first_iteration += done;
        out.group_first_iteration += done;
        out.iteration_count = count;
        out.first_light_path += paths_before(done);
        out.light_path_count = paths_before(done + count) - paths_before(done);
        return out;
    }
    friend bool operator==(const RenderUnit&, const RenderUnit&) = default;
};

}  // namespace lightloom
