#pragma once
// An image as textures and environment maps see it. 8-bit files stay 8-bit, with their decoding table, to save memory.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/vec.h"

namespace lightloom {

struct Image {
    int width = 0, height = 0;
    int channels = 3;                 ///< 1 or 3 (an alpha channel of the file becomes an Image of its own if used).
    std::vector<uint8_t> bytes;       ///< width * height * channels when 8-bit, row 0 at the top; empty otherwise.
    std::array<float, 256> decode{};  ///< 8-bit code to linear value.
    std::vector<float> floats;        ///< The same layout when not 8-bit.
    std::string name;                 ///< File it came from, for messages.

    bool empty() const { return width == 0 || height == 0; }
    size_t memory_bytes() const { return bytes.size() + floats.size() * sizeof(float); }
    float channel(int x, int y, int c) const {
        const size_t i = (size_t(y) * size_t(width) + size_t(x)) * size_t(channels) + size_t(c);
        return bytes.empty() ? floats[i] : decode[bytes[i]];
    }
    Rgb texel(int x, int y) const {
        if (channels == 1) return Rgb(channel(x, y, 0));
        return {channel(x, y, 0), channel(x, y, 1), channel(x, y, 2)};
    }
    /// Mean of all texels; the image must not be empty.
    Rgb mean() const {
        double sum[3] = {};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int c = 0; c < 3; ++c) sum[c] += double(channel(x, y, channels == 1 ? 0 : c));
        const double n = double(width) * height;
        return {float(sum[0] / n), float(sum[1] / n), float(sum[2] / n)};
    }
};

}  // namespace lightloom
