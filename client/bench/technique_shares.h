#pragma once
// Where an image's light and an algorithm's noise come from, by classes of techniques. Both are measured by rendering the frame
// several times with different seeds and looking at every contribution, so that they hold for any algorithm of the catalog that
// shows its contributions (Renderer::watch), whatever its weights are.

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "common/scene/scene.h"
#include "common/tables/tables.h"
#include "common/transport/settings.h"

namespace lightloom::client {

struct TechniqueShare {
    std::string_view name;  ///< Lives as long as the program.
    double light = 0;       ///< Of the image's mean, 0 to 1: what the class gets by the weights.
    double noise = 0;       ///< Of the sum of the classes' variances, 0 to 1. How classes vary together is in none of them.
};

struct TechniqueShares {
    uint32_t iterations = 0;       ///< Of each rendering.
    uint32_t seeds = 0;            ///< Renderings.
    double relative_variance = 0;  ///< Of a pixel after one iteration, over its squared mean: the sum over the classes.
    /// "emitter hits", "s = 1" (next event and cached points on lights), "2 <= s < k", "light tracing" and "merging", always all
    /// five and in this order. Where nothing varies every noise is 0; the shares of the light sum to 1.
    std::vector<TechniqueShare> classes;
};

/// Renders the whole frame `seeds` times, with the seeds from settings.seed on, `iterations` each. A class's variance is that
/// between the renderings, of the mean of red, green and blue, times the iterations, over the pixel's squared mean plus 1e-4; of
/// its pixels the noisiest 0.1 % are left out, because a single firefly would decide otherwise. The result does not depend on
/// the number of threads. `tables` are the algorithm's, empty where it needs none.
///
/// kInvalidArgument for fewer than two seeds, for no iterations, and for an algorithm that does its own loops and shows no
/// contributions; kFailedPrecondition where no technique finds light; kCancelled after a stop request; Renderer::create()'s
/// errors.
Result<TechniqueShares> technique_shares(std::shared_ptr<const Scene> scene, const RenderSettings& settings, const Tables& tables,
                                         uint32_t iterations, uint32_t seeds, std::stop_token stop);

}  // namespace lightloom::client
