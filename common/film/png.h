#pragma once
// 8-bit sRGB pictures in PNG format, for previews.

#include <cstdint>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/film/accumulation.h"

namespace lightloom {

/// The IEC 61966-2-1 transfer curve; linear and encoded values in [0, 1].
double srgb_encode(double linear);
double srgb_decode(double encoded);
/// The nearest 8-bit code of a linear value; below 0 and NaN give 0, above 1 gives 255.
uint8_t srgb_code(float linear);

/// The PNG file's bytes for `image` times 2^exposure (in stops), clipped to [0, 1].
Result<std::string> encode_png(const RgbImage& image, double exposure = 0);
/// Writes encode_png()'s bytes to a file that appears whole or not at all.
Status write_png(const std::string& path, const RgbImage& image, double exposure = 0);
/// The PNG file's bytes for 8-bit sRGB values, 3 * width * height.
Result<std::string> encode_png8(int width, int height, const std::vector<uint8_t>& rgb);
/// Writes encode_png8()'s bytes to a file that appears whole or not at all.
Status write_png8(const std::string& path, int width, int height, const std::vector<uint8_t>& rgb);

}  // namespace lightloom
