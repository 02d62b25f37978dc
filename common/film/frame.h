#pragma once
// Geometry of the film: the full frame, the rendered (crop) rectangle and the tiles of it.

#include <cstdint>

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

/// Largest crop window: a pixel's 28 bytes of a partial must fit EXR's 31-bit chunk size.
inline constexpr int64_t kMaxPartialPixels = (int64_t(1) << 31) / 28 - 1;

/// Longest side of the full frame.
inline constexpr int kMaxFrameSide = 65536;

/// The frame that a job renders. Splats and camera samples outside `crop` do not exist.
struct FrameLayout {
    int width = 0, height = 0;  ///< Full resolution.
    Rect crop;                  ///< Rendered window; the whole frame by default.
    friend bool operator==(const FrameLayout&, const FrameLayout&) = default;
};

}  // namespace lightloom
