#pragma once
// What a bidirectional algorithm finds, one connection at a time, before anything is weighted: renders add it to pixels, training
// units keep some of it.

#include "common/path/path_view.h"
#include "common/path/vertex.h"

namespace lightloom {

/// One way in which a camera sub-path and a light sub-path met: technique s, t with y[0 .. s-1] (s >= 2) and z[0 .. t-1]. x_0 is
/// apart because for s <= 1 it need not be on either array.
struct PathContribution {
    Rgb value;                  ///< Unweighted: f over the density of what was really drawn, all of an iteration's draws together.
    float inverse_density = 1;  ///< The same density but for roulette, as C(s) A(s) over it; splats: of one light path.
    int s = 0, t = 0;
    const PathVertex *y = nullptr, *z = nullptr;
    Vec3 position, normal;  ///< Of x_0; for an infinite light a point outside of the scene and the direction of travel.
    uint32_t emitter = 0;
    Vec2 film;           ///< Connections to the lens only.
    float survival = 1;  ///< Probability that roulette left both sub-paths: `value` was divided by it.

    /// A connection of a light sub-path to the lens, which may land in any pixel (not the sky behind the first camera ray).
    bool to_lens() const { return t == 1 && s > 0; }
};

}  // namespace lightloom
