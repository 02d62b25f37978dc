#pragma once
// The number of rays that next event estimation sends, and how far the weights trust it.

#include "common/core/by_depth.h"
#include "common/core/vec.h"
#include "common/path/path_view.h"

namespace lightloom {

/// The number of rays that a camera vertex sends to points on lights: it may be larger at the camera's first hit, where
/// direct light makes up most of an image and more rays need no walk.
struct NextEventRays : ByDepth<int> {
    using ByDepth::ByDepth;
    /// sigma / survivors(1) of next event estimation, as the weights need it.
    double sigma(const PathView& view) const { return double((*this)(view.k)) * trust(view) * view.next_event / view.fwd[0]; }

  private:
    /// Balancing by densities treats all techniques as equally noisy. But with a point light, next event estimation at
    /// the first hit chooses nothing but the light: if that has probability p, the estimate's relative variance is (1 -
    /// p) / p, whereas that of light paths is one over their expected number. A technique counts by its second moment
    /// over its variance [Grittmann et al. 2019, section 4.2]: 1 / (1 - p), bounded by the variation within a pixel.
    static double trust(const PathView& view) {
        constexpr double kWithinPixel = 1.0 / 1024;
        if (view.k != 2 || !view.discrete_source) return 1;
        return 1 / (1 - view.next_event + kWithinPixel);
    }
};

/// The i-th of `count` points that divide the unit square evenly (and, independently, the unit interval), whichever the
/// first one is: the steps are the generalised golden ratios of the plane and the line, modulo one.
inline Vec2 evenly_after(Vec2 first, int i) {
    if (i == 0) return first;
    const auto wrapped = [](float v) { return v < 1 ? v : v - 1; };
    const auto step = [i](double ratio) { return float(i * ratio - double(int(i * ratio))); };
    return {wrapped(first.x + step(0.7548776662466927)), wrapped(first.y + step(0.5698402909980532))};
}
inline double evenly_after(double first, int i) {
    if (i == 0) return first;
    const double moved = first + i * 0.6180339887498949;
    return moved - double(int(moved));
}

}  // namespace lightloom
