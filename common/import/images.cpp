#include "common/import/images.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "common/core/math.h"
#include "common/import/diagnostics.h"
#include "common/import/exr_image.h"
#include "common/import/file_source.h"

// The decoder for the small formats; everything that would touch files or allocate without bound is switched off.
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_TGA
#define STBI_ONLY_HDR
#define STBI_NO_STDIO
#define STBI_MAX_DIMENSIONS 16384
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image.h>
#pragma GCC diagnostic pop

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
std::vector<float> keep_scalar(const T* raw, size_t pixels, int channels, T opaque, F linear) {
    const size_t stride = size_t(channels);
    bool use_alpha = false;
    if (channels == 4)
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
void fill(Image* image, const T* raw, int channels, const ImageRequest& request, T opaque,
          const std::vector<float>& table) {
    const size_t pixels = size_t(image->width) * size_t(image->height);
    const auto linear = [&](T v) { return table.empty() ? float(v) : table[size_t(v)]; };
    if (request.channels == ImageChannels::kScalar) {
        image->channels = 1;
        image->floats = keep_scalar(raw, pixels, channels, opaque, linear);
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

std::vector<float> decoding_table(size_t codes, const ImageRequest& request) {
    std::vector<float> table(codes);
    for (size_t i = 0; i < codes; ++i) table[i] = float(decode(double(i) / double(codes - 1), request));
    return table;
}

Result<Image> read_with_stb(const std::string& bytes, const ImageRequest& request) {
    const stbi_uc* data = reinterpret_cast<const stbi_uc*>(bytes.data());
    const int size = int(bytes.size());
    Image image;
    int channels = 0;
    if (!stbi_info_from_memory(data, size, &image.width, &image.height, &channels))
        return invalid_argument(std::string("the image cannot be decoded: ") + stbi_failure_reason());
    LL_RETURN_IF_ERROR(
        check_image_size(uint64_t(image.width), uint64_t(image.height), uint64_t(channels), bytes.size()));
    const auto failed = [] { return data_loss(std::string("the image is damaged: ") + stbi_failure_reason()); };
    if (stbi_is_hdr_from_memory(data, size)) {
        const std::unique_ptr<float, void (*)(void*)> raw(
            stbi_loadf_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, request, 1.0f, {});
    } else if (stbi_is_16_bit_from_memory(data, size)) {
        const std::unique_ptr<stbi_us, void (*)(void*)> raw(
            stbi_load_16_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, request, stbi_us(65535), decoding_table(65536, request));
    } else {
        const std::unique_ptr<stbi_uc, void (*)(void*)> raw(
            stbi_load_from_memory(data, size, &image.width, &image.height, &channels, 0), stbi_image_free);
        if (!raw) return failed();
        fill(&image, raw.get(), channels, request, stbi_uc(255), decoding_table(256, request));
    }
    return image;
}

}  // namespace

Result<Image> read_image(const std::string& name, const std::string& bytes, const ImageRequest& request) {
    const std::string extension = lower_extension(name);
    if (bytes.size() > (size_t(1) << 30)) return invalid_argument("the image file is larger than 1 GiB");
    Result<Image> image =
        invalid_argument("images of type " + quoted(extension) + " are not supported; use png, jpg, tga, hdr or exr");
    if (extension == "exr") {
        Result<ExrPixels> exr = read_exr(bytes);
        if (!exr.ok()) return exr.status();
        Image out;
        out.width = exr->width;
        out.height = exr->height;
        fill(&out, exr->values.data(), exr->channels, request, 1.0f, {});
        image = std::move(out);
    } else if (extension == "png" || extension == "jpg" || extension == "jpeg" || extension == "tga" ||
               extension == "hdr") {
        image = read_with_stb(bytes, request);
    }
    if (!image.ok()) return image;
    if (!std::all_of(image->floats.begin(), image->floats.end(), [](float v) { return std::isfinite(v); }))
        return invalid_argument("the image holds a value that is not a finite number");
    image->name = name;
    return image;
}

}  // namespace lightloom::import
