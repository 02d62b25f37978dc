#pragma once
// Partial: everything that one work unit contributes to the image, as sums and counts. Values are summed in double in a
// fixed order (pixel by pixel in iteration order; splats in path order), so that a partial has the same bytes on every
// worker and with any number of threads.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/film/frame.h"
#include "common/film/rare_light.h"

namespace lightloom {

/// Sum of the splats of a unit in one pixel. Values are scaled such that the image is the sum over all units divided by
/// the total number of light paths.
struct SplatSum {
    uint32_t pixel = 0;  ///< Row-major in FrameLayout::crop.
    std::array<double, 3> rgb{};
    friend bool operator==(const SplatSum&, const SplatSum&) = default;
};

/// One sample that came out NaN or infinite. It was dropped before it was summed; this is enough to replay it.
struct DroppedSample {
    uint64_t iteration = 0;
    uint32_t pixel = 0;  ///< Row-major in FrameLayout::crop: where it was traced from (camera) or would have landed (splat).
    bool splat = false;
    friend bool operator==(const DroppedSample&, const DroppedSample&) = default;
};

struct UnitCounters {
    uint64_t camera_samples = 0;
    uint64_t light_paths = 0;
    uint64_t rays = 0;         ///< Closest-hit and shadow rays together.
    uint64_t vertices = 0;     ///< Surface vertices created by both kinds of walk.
    uint64_t connections = 0;  ///< Connections (next event included) whose visibility was tested.

    UnitCounters& operator+=(const UnitCounters& o) {
        camera_samples += o.camera_samples;
        light_paths += o.light_paths;
        rays += o.rays;
        vertices += o.vertices;
        connections += o.connections;
        return *this;
    }
};

struct Partial {
    Rect tile;                           ///< Pixels that `camera` covers, full-frame coordinates.
    uint32_t samples_per_pixel = 0;      ///< Camera samples in each pixel of the tile (= iterations of the unit).
    std::vector<double> camera;          ///< 3 * tile.area(), row-major, RGB interleaved: sums of camera samples.
    uint64_t light_paths = 0;            ///< Light paths whose splats are in `splats` (also those that hit nothing).
    std::vector<SplatSum> splats;        ///< Ascending by pixel, no pixel twice.
    uint64_t dropped_count = 0;          ///< Non-finite samples dropped.
    std::vector<DroppedSample> dropped;  ///< The first of them, at most kMaxDroppedRecords.
    UnitCounters counters;
    RareLight rare_light;  ///< Describes the whole job; only the job's first unit has it.

    static constexpr size_t kMaxDroppedRecords = 16;
};

/// Largest magnitudes in a partial.
struct PartialBounds {
    double camera = 0, splat = 0;
};

/// Checks everything that a Partial promises: a tile inside the crop, one sum per pixel and channel, splats inside the crop
/// in ascending order, no more dropped records than allowed, and only finite sums. kDataLoss names the first violation.
Result<PartialBounds> check_partial(const Partial& partial, const FrameLayout& frame);

}  // namespace lightloom
