#pragma once
// Separable convolution of float planes, as the perceptual metrics use it.

#include <cstddef>
#include <vector>

namespace lightloom {

/// One float per pixel, row-major.
struct Plane {
    int width = 0, height = 0;
    std::vector<float> values;

    Plane() = default;
    Plane(int w, int h) : width(w), height(h), values(size_t(w) * size_t(h)) {}
};

/// An odd number of taps; the middle one is at the pixel itself.
using Kernel = std::vector<float>;

/// sum_k kernel[k] * plane(x + k - radius, y); beyond the border its pixels are repeated.
Plane convolve_rows(const Plane& plane, const Kernel& kernel);
/// The same along y.
Plane convolve_columns(const Plane& plane, const Kernel& kernel);

}  // namespace lightloom
