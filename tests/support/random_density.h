#pragma once
// Density maps that know nothing, for weights that must sum to one whatever they hold.

#include "common/core/rng.h"
#include "common/scene/emitter.h"
#include "common/tables/train_density.h"

namespace lightloom::testing {

/// Of a few thousand random places about the origin, most of them close to one another, as if very few light sub-paths had left
/// them: discs hold between less than one photon and many more than there are light sub-paths.
inline DensityData random_density(const EmitterSet& emitters, uint64_t seed) {
    Rng rng({seed, Stage::kTraining, 0, 77});
    const float radius = emitters.scene_radius();
    std::vector<Vec3> places(4000);
    for (Vec3& p : places) {
        const auto coordinate = [&] {
            const float u = 2 * rng.uniform() - 1;
            return radius * u * u * u;
        };
        const float x = coordinate(), y = coordinate(), z = coordinate();
        p = {x, y, z};
    }
    return build_density_map(places, 1 + rng.below(300));
}

}  // namespace lightloom::testing
