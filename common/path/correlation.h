#pragma once
// Correlation of connections that share a sub-path [Grittmann, Georgiev and Slusallek 2021, section 4; algorithms.md 3.1]: N
// prefixes connected to one camera vertex are N samples of the light, but one of the camera sub-path. Counting them as N in the
// weights trusts them too much where the camera sub-path is the poor one.

#include <algorithm>

#include "common/path/path_view.h"

namespace lightloom {

/// c_s in [1/n, 1]: of n connections that split the path after s light vertices, n c_s count. A function of the path and n. Reads
/// the view's primary_distance2 and source.
inline double correlation_factor(const PathView& view, int s, double n) {
    constexpr double kDisc = 3.14159265358979323846 * 0.017455064928217585 * 0.017455064928217585;  // pi tan^2(1 degree)
    const double area = kDisc * view.primary_distance2;
    // The share of a sub-path's neighbours that the radius reaches; a Dirac event has no neighbours but itself.
    double camera = 1, light = 1;
    for (int i = s; i < view.k; ++i)
        if (i + 1 == view.k || !view.delta[i + 1]) camera *= std::min(area * view.rev[i], 1.0);
    if (view.source == PathView::Source::kArea) light *= std::min(area * view.fwd[0], 1.0);
    if (view.source == PathView::Source::kDirection) light *= std::min(kDisc * view.fwd[0], 1.0);
    for (int i = 1; i < s; ++i)
        if (!view.delta[i - 1]) light *= std::min(area * view.fwd[i], 1.0);
    const double either = camera + light * (1 - camera);  // rounds to no less than `camera`
    return either > 0 ? std::max(camera / either, 1 / n) : 1;
}

}  // namespace lightloom
