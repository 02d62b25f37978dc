#pragma once
// For the tests of materials, textures and lights: what a scene in memory looks like, and image files made in memory.

#include <array>

#include "common/scene/texture.h"
#include "import_testing.h"

namespace lightloom::testing {

inline const std::string kShape = " Shape \"sphere\" ";

/// The material of the first shape.
inline Material material_of(const SceneDescription& d) { return d.materials.at(size_t(d.spheres.at(0).attributes.material)); }

inline Rgb value(const SceneDescription& d, TextureId id, Vec2 uv = {0.3f, 0.3f}, const Vec3& p = {}) {
    return evaluate_texture({d.textures, d.images, d.materials, d.texture_spaces}, id, {uv, p});
}

/// An uncompressed 24-bit TGA; `bgr` holds rows from the bottom.
inline std::string tga(int width, int height, const std::string& bgr) {
    std::string out(18, '\0');
    out[2] = 2;
    out[12] = char(width);
    out[14] = char(height);
    out[16] = 24;
    return out + bgr;
}

/// A PNG of 8 bits per sample, stored without compression; `rows` begin with a filter byte each. The decoder checks no sums.
inline std::string png(int width, int height, int colour_type, const std::string& rows, const std::string& palette = "",
                       const std::string& transparency = "") {
    const auto big = [](size_t v) { return std::string{char(v >> 24), char(v >> 16), char(v >> 8), char(v)}; };
    const auto chunk = [&](const std::string& type, const std::string& data) {
        return big(data.size()) + type + data + std::string(4, '\0');
    };
    const size_t n = rows.size();
    const std::string stored = {'\x78', '\x01', '\x01', char(n), char(n >> 8), char(~n), char(~n >> 8)};
    std::string out = "\x89PNG\r\n\x1a\n" +
                      chunk("IHDR", big(size_t(width)) + big(size_t(height)) + char(8) + char(colour_type) + std::string(3, '\0'));
    if (!palette.empty()) out += chunk("PLTE", palette);
    if (!transparency.empty()) out += chunk("tRNS", transparency);
    return out + chunk("IDAT", stored + rows + std::string(4, '\0')) + chunk("IEND", "");
}

/// A scan-line EXR of one pixel of float colour with these chromaticities: red, green, blue, white.
inline std::string exr(const Rgb& colour, const std::array<float, 8>& xy) {
    const auto bytes = [](const auto& v) { return std::string(reinterpret_cast<const char*>(&v), sizeof v); };
    const auto attribute = [&](const std::string& name, const std::string& type, const std::string& value) {
        return name + '\0' + type + '\0' + bytes(int32_t(value.size())) + value;
    };
    std::string channels;
    for (const char c : {'B', 'G', 'R'})  // of type FLOAT, not sub-sampled
        channels += std::string{c, '\0'} + bytes(std::array<int32_t, 4>{2, 0, 1, 1});
    const std::array<int32_t, 4> window{0, 0, 0, 0};
    std::string out = bytes(int32_t(20000630)) + bytes(int32_t(2));
    out += attribute("channels", "chlist", channels + '\0') + attribute("chromaticities", "chromaticities", bytes(xy));
    out += attribute("compression", "compression", std::string(1, '\0')) + attribute("dataWindow", "box2i", bytes(window));
    out += attribute("displayWindow", "box2i", bytes(window)) + attribute("lineOrder", "lineOrder", std::string(1, '\0'));
    out += attribute("pixelAspectRatio", "float", bytes(1.0f));
    out += attribute("screenWindowCenter", "v2f", bytes(std::array<float, 2>{}));
    out += attribute("screenWindowWidth", "float", bytes(1.0f)) + '\0';
    out += bytes(uint64_t(out.size() + 8));
    return out + bytes(int32_t(0)) + bytes(int32_t(12)) + bytes(colour.b) + bytes(colour.g) + bytes(colour.r);
}

}  // namespace lightloom::testing
