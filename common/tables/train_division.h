#pragma once
// Learns the light subspaces of points x_0 on finite lights: clusters of those that matter, like those of longer prefixes
// (train_classifier.h), and some of those that emit but that no path came from, so that what is never seen does not share
// its subspaces with what is. Infinite lights get a share of the cells, but no clusters: those were no better than
// a grid (measured). Deterministic. [common/path/README.md, "Classifier"]

#include <cstdint>
#include <stop_token>
#include <vector>

#include "common/tables/light_division.h"

namespace lightloom {

/// A point x_0; see LightDivision::label().
struct WeightedSource {
    uint32_t emitter = 0;
    Vec3 position, w;
    float weight = 0;     ///< Non-negative.
    float per_cache = 0;  ///< Emitted points: how many points of one cache of the render this one stands for.
};

struct DivisionOptions {
    uint32_t cells = 1;    ///< Upper bound of the labels, at least 1; they are numbered from 0.
    double fewest = 0;     ///< Points that a cache is expected to hold in each part of a cell that is divided, at least.
    std::stop_token stop;  ///< After a stop request the function returns soon, with a division of no use.
};

/// `seen` are points from which light came, with its contribution; `emitted` starting points of light sub-paths, with their
/// throughput. Either may be empty. (label >> b) is a coarser classification, as in train_classifier(), except that points
/// of finite and infinite lights meet in one of its subspaces.
LightDivision train_division(const EmitterSet& emitters, const std::vector<WeightedSource>& seen,
                             const std::vector<WeightedSource>& emitted, const DivisionOptions& options);

}  // namespace lightloom
