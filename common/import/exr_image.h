#pragma once
// Reads OpenEXR files by a plain function.

#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/core/vec.h"

namespace lightloom::import {

/// Primaries by the header's chromaticities; a file without them has Rec. 709's.
enum class ExrPrimaries { kRec709, kDisplayP3, kRec2020 };

/// Luminances of red, green and blue.
Rgb luminance_weights(ExrPrimaries primaries);

struct ExrPixels {
    int width = 0, height = 0;
    int channels = 0;  ///< 1 (Y or a single channel), 3 (R, G, B, or the first three) or 4 (with A).
    ExrPrimaries primaries = ExrPrimaries::kRec709;
    std::vector<float> values;  ///< Row 0 at the top.
};

enum class ExrChannels {
    kColour,      ///< R, G, B and A if there; otherwise Y or the only one.
    kFirstThree,  ///< The first three in the file's order, which is alphabetical, as some of pbrt's code does.
};

/// Decodes a scan-line or tiled EXR, of a multi-part file the first part. Primaries that ExrPrimaries does not list are an error.
Result<ExrPixels> read_exr(const std::string& bytes, ExrChannels channels = ExrChannels::kColour);

/// The most values that a byte of a file can stand for. Deflate makes up to 1032 bytes of one. In a PNG such a byte may
/// hold eight codes of a palette, each of which becomes four channels.
inline constexpr uint64_t kPngValuesPerByte = 1032 * 8 * 4;
/// DWA deflates the coefficients of a discrete cosine transformation of blocks of 64 values; nothing else in OpenEXR
/// packs more.
inline constexpr uint64_t kExrValuesPerByte = 1032 * 64;
/// JPEG needs a bit for a block of at most 64 pixels and repeats its colours at half the resolution; TGA and HDR pack far less.
inline constexpr uint64_t kOtherValuesPerByte = 4096;

/// Refuses dimensions that are unreasonable or cannot fit into so few bytes, before memory of that size is allocated.
Status check_image_size(uint64_t width, uint64_t height, uint64_t channels, uint64_t file_bytes,
                        uint64_t values_per_byte = kOtherValuesPerByte);

}  // namespace lightloom::import
