#pragma once
// Geometry of the film: the full frame, the rendered (crop) rectangle and the tiles of it.

#include <cstdint>
#include <string>

namespace lightloom {

/// Half-open pixel rectangle, in full-frame coordinates (0, 0 = top left).
struct Rect {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

    int width() const { return x1 - x0; }
    int height() const { return y1 - y0; }
    int64_t area() const { return int64_t(width()) * height(); }
    bool empty() const { return x1 <= x0 || y1 <= y0; }
    bool contains(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
    /// Row-major index of a pixel inside this rectangle.
    int64_t index(int x, int y) const { return int64_t(y - y0) * width() + (x - x0); }
    friend bool operator==(const Rect&, const Rect&) = default;
};

/// Most pixels of a crop window: with so many, 32 bits can still number the pixels and the values of all pixels.
inline constexpr int64_t kMaxPartialPixels = int64_t(1) << 28;

/// Memory that a job's sums take per pixel while it is rendered, for the sums of all complete groups and of the
/// incomplete one: at most 24 bytes for each of five arrays of sums (server/reducer.h), rounded up.
inline constexpr int64_t kFrameBytesPerPixel = 128;

/// Returns "P pixels, which take G GB of memory while they are rendered (256 bytes each)".
inline std::string pixels_and_memory(int64_t pixels) {
    return std::to_string(pixels) + " pixels, which take " +
           std::to_string((pixels * kFrameBytesPerPixel + 999999999) / 1000000000) + " GB of memory while they are rendered (" +
           std::to_string(kFrameBytesPerPixel) + " bytes each)";
}

/// Longest side of the full frame.
inline constexpr int kMaxFrameSide = 65536;

/// The frame that a job renders. Splats and camera samples outside `crop` do not exist.
struct FrameLayout {
    int width = 0, height = 0;  ///< Full resolution.
    Rect crop;                  ///< Rendered window; the whole frame by default.
    friend bool operator==(const FrameLayout&, const FrameLayout&) = default;
};

}  // namespace lightloom
