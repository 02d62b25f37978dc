#pragma once
// light_throughput[s], the scalar of F(s) / C(s) for every hypothetical light prefix of a full path [common/path/README.md,
// "Notation"]: what light tracing would carry to x_{s-1}, free of Russian roulette. Methods that select light vertices in
// proportion to it need it in their weights, whichever technique made the path.
//
// F and C share the geometry of every edge, so their ratio is a product of BSDF values over solid-angle densities: no areas, no
// distances, and single precision is enough for it at any scale of the scene.

#include "common/path/connect.h"

namespace lightloom {

/// Fills in light_throughput of a path with s light vertices (of a merge, including the one that both sub-paths share) that was
/// completed with ViewDetail::kSubspace from light prefix
/// y[0 .. s-1] (s >= 2; for s <= 1 y is not read) and camera suffix z[0 .. t-1].
inline void view_throughput(const LightSubPath& y, int s, const PathVertex* z, PathView* view) {
    const int k = view->k;
    Rgb beta;
    int known = s;  // light_throughput is filled up to here
    if (s >= 2) {
        for (int i = 0; i < s; ++i) view->light_throughput[i + 1] = double(scalar_of(y[i].alpha) * y[i].survival);
        beta = y[s - 1].alpha * y[s - 1].survival;
    } else {
        view->light_throughput[1] = double(scalar_of(view->start[0]));
        beta = view->start[1];
        view->light_throughput[2] = double(scalar_of(beta));
        known = 2;
    }
    for (int p = known + 1; p < k; ++p) {
        const int i = p - 2;  // the vertex that the longer prefix crosses
        // The technique's own end vertices have their steps in the view; those behind them were walked by the camera.
        beta *= i <= s ? view->step[i] : z[k - i].step;
        view->light_throughput[p] = double(scalar_of(beta));
    }
}

}  // namespace lightloom
