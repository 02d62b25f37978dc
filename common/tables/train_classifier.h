#pragma once
// Learns kappa: centroids among the ends of important sub-paths, labels by the nearest centroid, and a decision tree that
// reproduces those labels. Deterministic for a given seed. [Su, Li and Wang 2022, sections 6.4 and 7.2; common/path/README.md,
// "Classifier"]

#include <cstdint>
#include <stop_token>
#include <vector>

#include "common/tables/classifier.h"

namespace lightloom {

struct WeightedEnd {
    SubPathEnd end;
    float weight = 0;  ///< Non-negative.
};

struct ClassifierOptions {
    uint32_t subspaces = 1;  ///< Labels first_label .. first_label + subspaces - 1.
    uint32_t first_label = 0;
    float direction_weight = 0.05f;  ///< k_d.
    uint64_t seed = 0;
    std::stop_token stop;  ///< After a stop request the function returns soon, with a tree of no use.
};

/// At most options.subspaces labels are used (fewer when there are fewer distinct ends). Labels are in the order of a balanced
/// tree over the centroids: labels that agree in their upper bits are neighbours in space, so that (label - first) >> b is a
/// nested, coarser classification.
SubspaceTree train_classifier(const std::vector<WeightedEnd>& ends, const ClassifierOptions& options);

}  // namespace lightloom
