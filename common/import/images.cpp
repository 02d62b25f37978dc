#include "common/import/images.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "common/core/math.h"
#include "common/import/diagnostics.h"
#include "common/import/exr_image.h"
#include "common/import/file_source.h"
#include "common/import/pfm_image.h"

// The decoder for the small formats; everything that would open files or allocate without bound is switched off.
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_TGA
#define STBI_ONLY_HDR
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
// Its conversions between 8-bit and floating-point pixels use pow(); it is replaced by ours, because libm's depends on
// the host. (The standard header is included above already, so that only the decoder sees the macro.)
#define pow(base, exponent) ::lightloom::math::pow(double(base), double(exponent))
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop
#undef pow

namespace lightloom::import {
namespace {

double decode(double code, const ImageRequest& request) {
    if (!request.srgb) return request.gamma == 1 ? code : math::pow(code, double(request.gamma));
    return code <= 0.04045 ? code / 12.92 : math::pow((code + 0.055) / 1.055, 2.4);
}

/// Keeps the requested channels of `raw` (w * h * channels values of type T).
template <typename T>
std::vector<T> keep_colour(const T* raw, size_t pixels, int channels) {
    const size_t kept = channels >= 3 ? 3 : 1;
    std::vector<T> out(pixels * kept);
    for (size_t i = 0; i < pixels; ++i)
        for (size_t c = 0; c < kept; ++c) out[i * kept + c] = raw[i * size_t(channels) + c];
    return out;
}

/// One channel of linear values, see ImageChannels::kScalar; `linear` maps a T to its value.
template <typename T, typename F>
std::vector<float> keep_scalar(const T* raw, size_t pixels, int channels, bool has_alpha, T opaque, F linear) {
    const size_t stride = size_t(channels);
    bool use_alpha = false;
    if (channels == 4 && has_alpha)
        for (size_t i = 0; i < pixels && !use_alpha; ++i) use_alpha = raw[i * 4 + 3] != opaque;
    std::vector<float> out(pixels);
    for (size_t i = 0; i < pixels; ++i) {
        const T* p = raw + i * stride;
        if (use_alpha)
            out[i] = linear(p[3]);
        else if (channels >= 3)
            out[i] = (linear(p[0]) + linear(p[1]) + linear(p[2])) * (1.0f / 3.0f);
        else
            out[i] = linear(p[0]);
    }
    return out;
}

template <typename T>
/// `has_alpha`: a fourth channel counts, see ImageChannels::kScalar.
void fill(Image* image, const T* raw, int channels, bool has_alpha, const ImageRequest& request, T opaque,
          const std::vector<float>& table) {
    const size_t pixels = size_t(image->width) * size_t(image->height);
    const auto linear = [&](T v) { return table.empty() ? float(v) : table[size_t(v)]; };
    if (request.channels == ImageChannels::kScalar) {
        image->channels = 1;
        image->floats = keep_scalar(raw, pixels, channels, has_alpha, opaque, linear);
        return;
    }
    image->channels = channels >= 3 ? 3 : 1;
    if constexpr (sizeof(T) == 1) {
        image->bytes = keep_colour(raw, pixels, channels);
        std::copy(table.begin(), table.end(), image->decode.begin());
    } else {
        const std::vector<T> kept = keep_colour(raw, pixels, channels);
        image->floats.resize(kept.size());
        std::transform(kept.begin(), kept.end(), image->floats.begin(), linear);
    }
}

/// Converts to the renderer's primaries. Colours outside of the gamut are moved to its border at equal luminance.
void to_srgb_primaries(ExrPrimaries from, Image* image, bool* clipped) {
    if (from == ExrPrimaries::kRec709) return;
    // Both spaces have the white D65 (SMPTE EG 432-1, ITU-R BT.2020).
    constexpr double kP3[3][3] = {{1.2249402, -0.2249402, 0.0}, {-0.0420569, 1.0420569, 0.0}, {-0.0196376, -0.0786361, 1.0982736}};
    constexpr double kRec2020[3][3] = {
        {1.6604910, -0.5876411, -0.0728499}, {-0.1245505, 1.1328999, -0.0083494}, {-0.0181508, -0.1005789, 1.1187297}};
    const auto& m = from == ExrPrimaries::kDisplayP3 ? kP3 : kRec2020;
    for (size_t i = 0; i + 2 < image->floats.size(); i += 3) {
        float* const p = &image->floats[i];
        const double rgb[3] = {p[0], p[1], p[2]};
        for (int c = 0; c < 3; ++c) p[c] = float(m[c][0] * rgb[0] + m[c][1] * rgb[1] + m[c][2] * rgb[2]);
        const Rgb exact(p[0], p[1], p[2]), inside(std::max(p[0], 0.0f), std::max(p[1], 0.0f), std::max(p[2], 0.0f));
        if (inside == exact) continue;
        // The rounding of the matrices is not worth a warning.
        if (std::min({p[0], p[1], p[2]}) < -1e-3f * inside.luminance()) *clipped = true;
        const float scale = inside.luminance() > 0 ? std::max(exact.luminance(), 0.0f) / inside.luminance() : 0;
        for (int c = 0; c < 3; ++c) p[c] = inside[c] * scale;
    }
}

std::vector<float> decoding_table(size_t codes, const ImageRequest& request) {
    std::vector<float> table(codes);
    for (size_t i = 0; i < codes; ++i) table[i] = float(decode(double(i) / double(codes - 1), request));
    return table;
}

/// Whether a PNG's header has the colour type "truecolour with alpha". For pbrt-v4, the alpha that the decoder makes of
/// a palette or of a transparent colour does not count.
bool is_rgba_png(const std::string& bytes) {
    constexpr size_t kColourType = 25;
    return bytes.size() > kColourType && bytes.compare(1, 3, "PNG") == 0 && bytes[kColourType] == 6;
}

Result<Image> read_with_stb(const std::string& bytes, const ImageRequest& request) {
    const bool has_alpha = is_rgba_png(bytes);
    const stbi_uc* data = reinterpret_cast<const stbi_uc*>(bytes.data());
    const int size = int(bytes.size());
    Image image;
    int channels = 0;
    if (!stbi_info_from_memory(data, size, &image.width, &image.height, &channels))
        return invalid_argument(std::string("the image cannot be decoded: ") + stbi_failure_reason());
    const bool png = bytes.compare(0, 4, "\x89PNG") == 0;
    LL_RETURN_IF_ERROR(check_image_size(uint64_t(image.width), uint64_t(image.height), uint64_t(channels), bytes.size(),
                                        png ? kPngValuesPerByte : kOtherValuesPerByte));
    const auto failed = [] { return data_loss(std::string("the image is damaged: ") + stbi_failure_reason()); };
    if (stbi_is_hdr_from_memory(data, size)) {
        const std::unique_ptr<float, void (*)(void*)> raw(
            stbi_loadf_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, has_alpha, request, 1.0f, {});
    } else if (stbi_is_16_bit_from_memory(data, size)) {
        const std::unique_ptr<stbi_us, void (*)(void*)> raw(
            stbi_load_16_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, has_alpha, request, stbi_us(65535), decoding_table(65536, request));
    } else {
        const std::unique_ptr<stbi_uc, void (*)(void*)> raw(
            stbi_load_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, has_alpha, request, stbi_uc(255), decoding_table(256, request));
    }
    return image;
}

}  // namespace

bool has_fixed_encoding(const std::string& name) {
    const std::string extension = lower_extension(name);
    return extension == "jpg" || extension == "jpeg" || extension == "tga";
}

Result<Image> read_image(const std::string& name, const std::string& bytes, const ImageRequest& request, std::string* warning) {
    bool out_of_gamut = false;
    const std::string extension = lower_extension(name);
    if (bytes.size() > (size_t(1) << 30)) return invalid_argument("the image file is larger than 1 GiB");
    Result<Image> image =
        invalid_argument("images of type " + quoted(extension) + " are not supported; use png, jpg, tga, hdr, pfm or exr");
    if (extension == "exr") {
        Result<ExrPixels> exr = read_exr(bytes);
        if (!exr.ok()) return exr.status();
        Image out;
        out.width = exr->width;
        out.height = exr->height;
        fill(&out, exr->values.data(), exr->channels, true, request, 1.0f, {});
        if (request.channels == ImageChannels::kColour && out.channels == 3) to_srgb_primaries(exr->primaries, &out, &out_of_gamut);
        image = std::move(out);
    } else if (extension == "pfm") {
        const Result<PfmPixels> pfm = read_pfm(bytes, warning);
        if (!pfm.ok()) return pfm.status();
        Image out;
        out.width = pfm->width;
        out.height = pfm->height;
        fill(&out, pfm->values.data(), pfm->channels, false, request, 1.0f, {});
        image = std::move(out);
    } else if (has_fixed_encoding(name)) {
        image = read_with_stb(bytes, {request.channels});
    } else if (extension == "png" || extension == "hdr") {
        image = read_with_stb(bytes, request);
    }
    if (!image.ok()) return image;
    if (!std::all_of(image->floats.begin(), image->floats.end(), [](float v) { return std::isfinite(v); }))
        return invalid_argument("the image holds a value that is not a finite number");
    image->name = name;
    if (request.channels == ImageChannels::kColour) {
        bool negative = false;
        for (float& v : image->floats) {
            negative = negative || v < 0;
            v = std::max(v, 0.0f);
        }
        const auto warn = [&](const char* text) { *warning += (warning->empty() ? "" : "; ") + std::string(text); };
        if (out_of_gamut)
            warn("colours outside of sRGB's gamut lose saturation at equal luminance");
        else if (negative)
            warn("negative values become 0, as in pbrt");
    }
    return image;
}

}  // namespace lightloom::import
