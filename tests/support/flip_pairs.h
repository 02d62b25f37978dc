#pragma once
// Pairs of images made by formulas, on which FLIP was also computed with its authors' code (flip_reference_test.cpp).
// They use nothing but integers and +, -, *, / of floats, so that every machine makes the same ones. Whoever changes a
// formula has to compute the authors' figures anew.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/film/accumulation.h"

namespace lightloom::flip_pairs {

struct Color {
    float r, g, b;
};
using Picture = std::function<Color(int x, int y)>;

inline RgbImage draw(int width, int height, const Picture& picture) {
    RgbImage image{width, height, {}};
    image.pixels.reserve(size_t(width) * size_t(height) * 3);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const Color c = picture(x, y);
            image.pixels.insert(image.pixels.end(), {c.r, c.g, c.b});
        }
    }
    return image;
}

/// In [0, 1), a hash of its arguments.
inline float noise(int x, int y, int channel) {
    uint32_t h = uint32_t(x) * 0x9e3779b1u ^ uint32_t(y) * 0x85ebca77u ^ uint32_t(channel + 1) * 0xc2b2ae3du;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return float((h ^ (h >> 15)) >> 8) * 0x1p-24f;
}

inline Color times(Color c, float r, float g, float b) { return {c.r * r, c.g * g, c.b * b}; }

/// Soft gradients in red and blue and a checkerboard in green.
inline Color room(int x, int y) {
    return {0.1f + 0.8f * float(x) / 97.0f, (x / 8 + y / 8) % 2 ? 0.7f : 0.2f, 0.05f + 0.9f * float(y) / 61.0f};
}

/// The room in the dark, with a lamp of 400 and a window of 30.
inline Color lit_room(int x, int y) {
    if (x >= 60 && x < 70 && y >= 8 && y < 14) return {400, 350, 250};
    if (x < 25 && y >= 20 && y < 40) return {20, 25, 30};
    return times(room(x, y), 0.3f, 0.2f, 0.1f);
}

/// Multiplies by 0.5 .. 1.5 per pixel and channel: noise as a path tracer leaves it.
inline Color noisy(Color c, int x, int y) { return times(c, 0.5f + noise(x, y, 0), 0.5f + noise(x, y, 1), 0.5f + noise(x, y, 2)); }

/// Blocks of 5 x 5 pixels, each channel 0 or 1, some of them outside [0, 1].
inline Color corners_of_the_cube(int x, int y, int seed) {
    const auto channel = [&](int c) {
        const float v = noise(x / 5 + 1000 * seed, y / 5, c);
        return v < 0.05f ? -0.5f : v < 0.5f ? 0.0f : v < 0.95f ? 1.0f : 3.0f;
    };
    return {channel(0), channel(1), channel(2)};
}

struct Pair {
    std::string name;
    RgbImage image, reference;
};

inline constexpr int kWidth = 97, kHeight = 61;  ///< Of all pairs but one.

inline std::vector<Pair> all() {
    const auto pair = [](const char* name, const Picture& image, const Picture& reference, int width = kWidth,
                         int height = kHeight) {
        return Pair{name, draw(width, height, image), draw(width, height, reference)};
    };
    const auto constant = [](float r, float g, float b) { return [=](int, int) { return Color{r, g, b}; }; };
    const auto step = [](int at) {
        return [=](int x, int y) {
            const float v = 3 * x + y < 3 * at ? 0.1f : 0.6f;
            return Color{v, v, v};
        };
    };
    const auto dots = [](float strength) {
        return [=](int x, int y) {
            const float v = x % 16 == 5 && y % 12 == 7 ? 0.2f + strength : 0.2f;
            return Color{v, v, v};
        };
    };
    return {
        pair("equal", room, room),
        pair("black and white", constant(0, 0, 0), constant(1, 1, 1)),
        pair("green and blue", constant(0, 1, 0), constant(0, 0, 1)),
        pair("step moved by a pixel", step(56), step(55)),
        pair("dots", dots(0.7f), dots(0)),
        pair(
            "hue", [](int x, int y) { return times(room(x, y), 0.9f, 1.0f, 1.1f); }, room),
        pair(
            "fine checks and their mean",
            [](int x, int y) {
                const float v = (x + y) % 2 ? 0.6f : 0.4f;
                return Color{v, v, v};
            },
            constant(0.5f, 0.5f, 0.5f)),
        pair(
            "noise", [](int x, int y) { return noisy(room(x, y), x, y); }, room),
        pair(
            "corners of the cube", [](int x, int y) { return corners_of_the_cube(x, y, 1); },
            [](int x, int y) { return corners_of_the_cube(x, y, 2); }),
        pair(
            "smaller than the filters", [](int x, int y) { return noisy(room(9 * x, 9 * y), x, y); },
            [](int x, int y) { return room(9 * x, 9 * y); }, 7, 5),
        pair(
            "lamp, noise", [](int x, int y) { return noisy(lit_room(x, y), x, y); }, lit_room),
        pair(
            "lamp, a stop darker", [](int x, int y) { return times(lit_room(x, y), 0.5f, 0.5f, 0.5f); }, lit_room),
        pair(
            "lamp, fireflies",
            [](int x, int y) {
                return noise(x, y, 7) < 0.01f ? Color{80, 60, 20} : lit_room(x, y);
            },
            lit_room),
    };
}

}  // namespace lightloom::flip_pairs
