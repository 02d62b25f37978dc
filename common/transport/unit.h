#pragma once
// RenderUnit: the part of the image that one call of a renderer makes. Plain data that the plan, transport and tests
// share.

#include <cstdint>

#include "common/film/frame.h"

namespace lightloom {

struct RenderUnit {
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;  ///< Iterations; camera samples per pixel of the tile, unless the unit only splats.
    /// First iteration of the whole group, which is part of the keys of its light paths. It differs from
    /// first_iteration only when a part of a unit is rendered again (replay).
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
    friend bool operator==(const RenderUnit&, const RenderUnit&) = default;
};

}  // namespace lightloom
