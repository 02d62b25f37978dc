#include "common/metrics/convolution.h"

#include <algorithm>

namespace lightloom {

Plane convolve_rows(const Plane& plane, const Kernel& kernel) {
    Plane result(plane.width, plane.height);
    const int radius = int(kernel.size() / 2), width = plane.width;
    std::vector<float> row(size_t(width) + 2 * size_t(radius));
    for (int y = 0; y < plane.height; ++y) {
        const float* from = plane.values.data() + size_t(y) * size_t(width);
        std::fill_n(row.begin(), radius, from[0]);
        std::copy_n(from, width, row.begin() + radius);
        std::fill_n(row.begin() + radius + width, radius, from[width - 1]);
        float* to = result.values.data() + size_t(y) * size_t(width);
        for (size_t k = 0; k < kernel.size(); ++k) {
            const float weight = kernel[k];
            const float* shifted = row.data() + k;
            for (int x = 0; x < width; ++x) to[x] += weight * shifted[x];
        }
    }
    return result;
}

Plane convolve_columns(const Plane& plane, const Kernel& kernel) {
    Plane result(plane.width, plane.height);
    const int radius = int(kernel.size() / 2), width = plane.width;
    for (int y = 0; y < plane.height; ++y) {
        float* to = result.values.data() + size_t(y) * size_t(width);
        for (size_t k = 0; k < kernel.size(); ++k) {
            const int source = std::clamp(y + int(k) - radius, 0, plane.height - 1);
            const float weight = kernel[k];
            const float* from = plane.values.data() + size_t(source) * size_t(width);
            for (int x = 0; x < width; ++x) to[x] += weight * from[x];
        }
    }
    return result;
}

}  // namespace lightloom
