#pragma once
// OpenEXR behind a plain function.

#include <string>
#include <vector>

#include "common/core/result.h"

namespace lightloom::import {

struct ExrPixels {
    int width = 0, height = 0;
    int channels = 0;           ///< 1 (Y or a single channel), 3 (R, G, B) or 4 (with A).
    std::vector<float> values;  ///< Row 0 at the top.
};

/// Decodes a scan-line or tiled EXR. The first part of a multi-part file is read.
Result<ExrPixels> read_exr(const std::string& bytes);

/// Refuses dimensions that are unreasonable or that so few bytes cannot hold, before memory of that size is asked for.
Status check_image_size(uint64_t width, uint64_t height, uint64_t channels, uint64_t file_bytes);

}  // namespace lightloom::import
