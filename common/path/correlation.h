#pragma once
// Correlation of connections that share a sub-path [Grittmann, Georgiev and Slusallek 2021, section 3; common/path/README.md,
// "Correlation"]: N prefixes connected to one camera vertex are N samples of the light, but one of the camera sub-path. Counting
// them as N in the weights trusts them too much where the camera sub-path is the poor one.

#include <algorithm>

#include "common/path/light_vertex.h"
#include "common/path/path_view.h"
#include "common/scene/emitter.h"

namespace lightloom {

/// Sets what correlation_factor() reads of a path that starts on `e` and was made from light prefix y[0 .. s-1] and
/// camera suffix z[0 .. t-1].
inline void view_footprint(const Emitter& e, const LightSubPath& y, int s, const PathVertex* z, int t, PathView* view) {
    view->primary_distance2 = double(length_squared((t >= 2 ? z[1].p : y[s - 1].p) - z[0].p));
    view->source = e.is_discrete()   ? PathView::Source::kDiscrete
                   : e.is_infinite() ? PathView::Source::kDirection
                                     : PathView::Source::kArea;
}

/// c_s in [1/n, 1]: of n connections that split the path after s light vertices, n c_s count. The factor is a function
/// of the path and n; it reads what view_footprint() wrote.
inline double correlation_factor(const PathView& view, int s, double n) {
    constexpr double kDisc = 3.14159265358979323846 * 0.017455064928217585 * 0.017455064928217585;  // pi tan^2(1 degree)
    const double area = kDisc * view.primary_distance2;
    // Shares of either sub-path's neighbours within the radius; a Dirac event has no neighbour but itself.
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
