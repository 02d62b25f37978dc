#pragma once
// How many rays next event estimation sends, and how far the weights trust it.

#include "common/core/vec.h"
#include "common/path/path_view.h"

namespace lightloom {

/// The number that a camera vertex sends to points on lights: more where the camera's first hit is lit directly, which is most of
/// what an image shows and costs no walk.
struct NextEventRays {
    int at_first = 1;  ///< From the first vertex.
    int later = 1;     ///< From every later one.

    /// Of the last of a camera sub-path of t vertices, t >= 2.
    int operator()(int t) const { return t == 2 ? at_first : later; }
    /// sigma / survivors(1) of next event estimation, as the weights ask for it.
    double sigma(const PathView& view) const { return double((*this)(view.k)) * trust(view) * view.next_event / view.fwd[0]; }

  private:
    /// Balancing by densities holds all techniques for equally noisy. But a lamp that is a point leaves next event
    /// estimation nothing to choose at the first hit except which lamp: chosen with probability p, the estimate's relative variance
    /// is (1 - p) / p, where light paths bring the noise of their number, one over what is expected. A technique counts by its
    /// second moment over its variance [Grittmann et al. 2019, section 4.2]: 1 / (1 - p), bounded by what varies within a pixel.
    static double trust(const PathView& view) {
        constexpr double kWithinPixel = 1.0 / 1024;
        if (view.k != 2 || !view.discrete_source) return 1;
        return 1 / (1 - view.next_event + kWithinPixel);
    }
};

/// The i-th of `count` points that divide the unit square (and, apart from them, the unit interval) evenly, whichever the first
/// one is: steps of the generalised golden ratios of the plane and the line, modulo one.
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
