#pragma once
// Blocks of pixels: the unit in which training knows how bright the frame is.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/film/frame.h"

namespace lightloom {

/// Blocks into which the frame is divided, about; learning joins them where samples are few.
inline constexpr uint64_t kTrainingBlocks = 2500;

/// Divides a frame into about kTrainingBlocks square blocks. The size of the training set does not matter: nobody may know
/// it yet.
struct FrameBlocks {
    Rect crop;
    int edge = 1;  ///< Pixels.

    explicit FrameBlocks(const Rect& r) : crop(r) {
        edge = std::max(1, int(std::ceil(std::sqrt(double(r.area()) / double(kTrainingBlocks)))));
    }
    int columns() const { return (crop.width() + edge - 1) / edge; }
    int rows() const { return (crop.height() + edge - 1) / edge; }
    /// The block of a pixel of the crop.
    uint32_t at(int px, int py) const { return uint32_t(((py - crop.y0) / edge) * columns() + (px - crop.x0) / edge); }
};

}  // namespace lightloom
