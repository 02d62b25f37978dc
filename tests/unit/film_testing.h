#pragma once
// Partials for the tests of sums and of the partial codec.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "common/core/rng.h"
#include "common/film/partial.h"
#include "common/film/partial_exr.h"

namespace lightloom::testing {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

inline const FrameLayout kFrame{40, 30, {4, 3, 36, 27}};

/// A partial with radiance-like sums around `scale`; `splats` random pixels get a splat sum.
inline Partial random_partial(const FrameLayout& frame, const Rect& tile, uint64_t seed, uint32_t splats, double scale = 1) {
    Rng rng({seed});
    Partial partial;
    partial.tile = tile;
    partial.samples_per_pixel = 4;
    partial.camera.resize(size_t(tile.area()) * 3);
    for (double& v : partial.camera) v = scale * rng.uniform_double() * (1 << rng.below(12));
    partial.light_paths = 4 * uint64_t(tile.area());
    std::vector<uint32_t> pixels(size_t(frame.crop.area()));
    std::iota(pixels.begin(), pixels.end(), 0u);
    for (uint32_t i = 0; i < splats; ++i) {
        std::swap(pixels[i], pixels[i + rng.below(uint32_t(pixels.size()) - i)]);
    }
    std::sort(pixels.begin(), pixels.begin() + splats);
    for (uint32_t i = 0; i < splats; ++i) {
        const double r = rng.uniform_double(), g = rng.uniform_double(), b = 0.1 + rng.uniform_double();
        partial.splats.push_back({pixels[i], {scale * r, scale * g, scale * b}});
    }
    partial.counters = {partial.samples_per_pixel * uint64_t(tile.area()), partial.light_paths, 1000 + seed, 77, 5};
    partial.rare_light = {{0.5f, 0.25f, 0.125f}, {0, 1e-3f, 0}, 1e9, 77};
    partial.dropped_count = 20;
    partial.dropped = {{seed, 3, true}, {seed + 1, 7, false}};
    return partial;
}

inline std::vector<Rect> four_tiles(const Rect& crop) {
    const int xm = crop.x0 + crop.width() / 3, ym = crop.y0 + crop.height() / 2;
    return {{crop.x0, crop.y0, xm, ym}, {xm, crop.y0, crop.x1, ym}, {crop.x0, ym, xm, crop.y1}, {xm, ym, crop.x1, crop.y1}};
}

inline bool same(const Partial& a, const Partial& b) {
    return a.tile == b.tile && a.samples_per_pixel == b.samples_per_pixel && a.camera == b.camera &&
           a.light_paths == b.light_paths && a.splats == b.splats && a.dropped_count == b.dropped_count && a.dropped == b.dropped &&
           a.counters.rays == b.counters.rays && a.rare_light == b.rare_light;
}

inline PartialExpectation expectation_of(const Partial& p, const FrameLayout& frame) {
    return {frame, p.tile, p.samples_per_pixel, p.light_paths};
}

}  // namespace lightloom::testing
