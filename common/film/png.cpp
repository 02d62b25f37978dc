#include "common/film/png.h"

#include <png.h>

#include <algorithm>
#include <array>

#include "common/core/atomic_file.h"
#include "common/core/math.h"

namespace lightloom {

namespace {

/// Linear values at which the code changes: thresholds[k] is where code k becomes k + 1.
std::array<float, 255> make_thresholds() {
    std::array<float, 255> thresholds;
    for (int k = 0; k < 255; ++k) thresholds[size_t(k)] = float(srgb_decode((k + 0.5) / 255));
    return thresholds;
}

Result<std::string> encode(int width, int height, const uint8_t* rgb) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = png_uint_32(width);
    png.height = png_uint_32(height);
    png.format = PNG_FORMAT_RGB;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
    std::string bytes(size, '\0');
    const bool ok = png_image_write_to_memory(&png, bytes.data(), &size, 0, rgb, 0, nullptr) != 0;
    const std::string why = png.message;
    png_image_free(&png);
    if (!ok) return internal_error("PNG: the image cannot be encoded: " + why);
    bytes.resize(size);
    return bytes;
}

}  // namespace

double srgb_encode(double linear) { return linear <= 0.0031308 ? 12.92 * linear : 1.055 * math::pow(linear, 1 / 2.4) - 0.055; }

double srgb_decode(double encoded) { return encoded <= 0.04045 ? encoded / 12.92 : math::pow((encoded + 0.055) / 1.055, 2.4); }

uint8_t srgb_code(float linear) {
    static const std::array<float, 255> kThresholds = make_thresholds();
    if (!(linear > 0)) return 0;
    return uint8_t(std::upper_bound(kThresholds.begin(), kThresholds.end(), linear) - kThresholds.begin());
}

Result<std::string> encode_png(const RgbImage& image, double exposure) {
    if (image.width < 1 || image.height < 1 || image.pixels.size() != size_t(image.width) * size_t(image.height) * 3) {
        return invalid_argument("PNG: the image is empty or its size does not fit its pixels");
    }
    if (!(std::fabs(exposure) <= 100)) return invalid_argument("PNG: the exposure must lie between -100 and 100 stops");
    const double scale = math::pow(2, exposure);
    std::vector<uint8_t> codes(image.pixels.size());
    for (size_t i = 0; i < codes.size(); ++i) codes[i] = srgb_code(float(image.pixels[i] * scale));
    return encode(image.width, image.height, codes.data());
}

Status write_png(const std::string& path, const RgbImage& image, double exposure) {
    Result<std::string> bytes = encode_png(image, exposure);
    if (!bytes.ok()) return {bytes.status().code(), path + ": " + bytes.status().message()};
    return write_file_atomically(path, *bytes);
}

Result<std::string> encode_png8(int width, int height, const std::vector<uint8_t>& rgb) {
    if (width < 1 || height < 1 || rgb.size() != size_t(width) * size_t(height) * 3) {
        return invalid_argument("PNG: the image is empty or its size does not fit its pixels");
    }
    return encode(width, height, rgb.data());
}

Status write_png8(const std::string& path, int width, int height, const std::vector<uint8_t>& rgb) {
    Result<std::string> bytes = encode_png8(width, height, rgb);
    if (!bytes.ok()) return {bytes.status().code(), path + ": " + bytes.status().message()};
    return write_file_atomically(path, *bytes);
}

}  // namespace lightloom
