#pragma once
// The settings of a render as numbers: what the catalog's texts mean to transport and to training.

#include <cmath>

#include "common/core/result.h"
#include "common/path/mis.h"
#include "common/path/random_walk.h"
#include "common/tables/train.h"
#include "common/transport/renderer.h"

namespace lightloom {

/// Camera samples of a training unit; the last one may have fewer.
inline constexpr uint64_t kTrainingUnitSamples = uint64_t(1) << 14;

struct TransportParameters {
    RouletteRule roulette;
    Heuristic heuristic = Heuristic::kBalance;
    double light_paths = 0;  ///< N1, per pixel and iteration; 0 for algorithms that splat nothing.
    bool needs_tables = false;
    // Algorithms with a cache.
    int connections = 1;         ///< N
    uint64_t minimum_paths = 1;  ///< Of a unit's cache.
    bool ris_aware = false, correlation_aware = false;
    uint64_t training_samples = 0;
    double energy_paths = 1;     ///< M' / D: light sub-paths that measure Q, per training sample.
    uint64_t pilot_samples = 0;  ///< The first of them, traced without a guide; 0: all.
    TrainingOptions training;

    /// How many light sub-paths the training samples before number `sample` measure Q with.
    uint64_t energy_paths_before(uint64_t sample) const { return uint64_t(std::ceil(double(sample) * energy_paths)); }

    /// Unknown algorithm or parameter, value or depth out of range: a clear error.
    static Result<TransportParameters> read(const RenderSettings& settings);
};

}  // namespace lightloom
