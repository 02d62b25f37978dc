#pragma once
// Which paths only a hit of the emitter makes, judged by the path alone.

#include "common/path/path_view.h"

namespace lightloom::testing {

/// Whether some vertex scatters and no technique but the hit of the emitter (s = 0) can make the path: wherever it is cut, a Dirac
/// vertex is next to the cut. A lamp seen in a mirror has no scattering vertex and does not count. `light_alone`: the others
/// connect to points on lights only, as those of `path` do, so that a Dirac vertex x_1 is enough.
inline bool by_hits_only(const PathView& view, bool light_alone = false) {
    bool scatters = false;
    for (int i = 1; i < view.k; ++i) scatters |= !view.delta[i];
    if (!scatters) return false;
    for (int s = 1; s <= (light_alone ? 1 : view.k); ++s)
        if (!view.delta[s - 1] && !(s < view.k && view.delta[s])) return false;
    return true;
}

}  // namespace lightloom::testing
