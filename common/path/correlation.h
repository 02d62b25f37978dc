#pragma once
// Correlation of connections that share a sub-path [Grittmann, Georgiev and Slusallek 2021, section 3; common/path/README.md,
// "Correlation"]: N prefixes connected to one camera vertex are N samples of the light, but one of the camera sub-path. Counting
// them as N in the weights trusts them too much where the camera sub-path is the poor one.

#include <algorithm>

#include "common/path/light_vertex.h"
#include "common/path/path_view.h"
#include "common/scene/emitter.h"

namespace lightloom {

/// The measure of a light's x_0.
inline PathView::Source light_source(const Emitter& e) {
    return e.is_discrete() ? PathView::Source::kDiscrete : e.is_infinite() ? PathView::Source::kDirection : PathView::Source::kArea;
}

/// Sets what correlation_factor() reads of a path that starts on `e` and was made from light prefix y[0 .. s-1] and
/// camera suffix z[0 .. t-1].
inline void view_footprint(const Emitter& e, const LightSubPath& y, int s, const PathVertex* z, int t, PathView* view) {
    view->primary_distance2 = double(length_squared((t >= 2 ? z[1].p : y[s - 1].p) - z[0].p));
    view->source = light_source(e);
}

/// The same of a complete path, whichever technique it was made by: the emitter of a path without a light prefix is that on which
/// z_{t-1} lies, or the sky.
inline void view_footprint(const EmitterSet& emitters, const LightSubPath& y, int s, const PathVertex* z, int t, PathView* view) {
    const bool hit = s == 0 && view->k == t - 1;
    const int32_t emitter = s > 0 ? y[0].emitter : hit ? z[t - 1].emitter : emitters.environment_index();
    view_footprint(emitters[uint32_t(emitter)], y, s, z, t, view);
}

/// pi tan^2 of the paper's one degree: the radius is that share of the length of the camera's first edge.
inline constexpr double kCorrelationDisc = 3.14159265358979323846 * 0.017455064928217585 * 0.017455064928217585;

/// c_s in [1/n, 1]: of n connections that split the path after s light vertices, n c_s count. The factor is a function
/// of the path and n; it reads what view_footprint() wrote.
inline double correlation_factor(const PathView& view, int s, double n) {
    if (n <= 1) return 1;
    const double area = kCorrelationDisc * view.primary_distance2;
    // Shares of either sub-path's neighbours within the radius; a Dirac event has no neighbour but itself.
    double camera = 1, light = 1;
    for (int i = s; i < view.k; ++i)
        if (i + 1 == view.k || !view.delta[i + 1]) camera *= std::min(area * view.rev[i], 1.0);
    if (view.source == PathView::Source::kArea) light *= std::min(area * view.fwd[0], 1.0);
    if (view.source == PathView::Source::kDirection) light *= std::min(kCorrelationDisc * view.fwd[0], 1.0);
    for (int i = 1; i < s; ++i)
        if (!view.delta[i - 1]) light *= std::min(area * view.fwd[i], 1.0);
    const double either = camera + light * (1 - camera);  // rounds to no less than `camera`
    return either > 0 ? std::max(camera / either, 1 / n) : 1;
}

}  // namespace lightloom
