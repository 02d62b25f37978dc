#pragma once
// Portable float maps: a short text header, then 32-bit floats.

#include <string>
#include <vector>

#include "common/core/result.h"

namespace lightloom::import {

struct PfmPixels {
    int width = 0, height = 0;
    int channels = 0;           ///< 3 ("PF") or 1 ("Pf").
    std::vector<float> values;  ///< Row 0 at the top, although files begin with the bottom row.
};

/// Decodes a PFM. The header's scale gives the byte order by its sign (negative: little-endian) and multiplies the
/// values by its magnitude, as in pbrt-v4. Comments ('#' to the end of the line) and blanks may stand wherever the
/// header has a blank. `*warning` tells of bytes behind the pixels. The message does not name the file.
Result<PfmPixels> read_pfm(const std::string& bytes, std::string* warning);

}  // namespace lightloom::import
