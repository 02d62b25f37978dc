#pragma once
// From training data to tables: brightness of blocks, kappa, Q, Gamma, windows. [Su, Li and Wang 2022, section 5]
//
// Cleaning of the dataset, for what it trains only (no image is made of it): a path without a connectible edge teaches Gamma
// nothing and is left out, as is one whose numbers left the range of single precision (counted); w_X is cut at its 99.99 %
// quantile, so that one lucky path does not own a column; centroids see contributions cut at their 99.9 % quantile.

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>

#include "common/core/result.h"
#include "common/tables/subspace_tables.h"
#include "common/tables/train_gamma.h"
#include "common/tables/training_data.h"

namespace lightloom {

struct TrainingOptions {
    uint32_t light_subspaces = 1000, eye_subspaces = 1000;  ///< N_L, N_E: upper bounds.
    double source_share = 0.2;                              ///< Of the light subspaces, for points on lights.
    double direction_weight = 0.05;                         ///< k_d.
    double mix = 0.1;                                       ///< Conservative share of Gamma.
    GammaTrainer trainer = GammaTrainer::kMm;
    int connections = 3;        ///< N that rendering will use.
    double reuse_target = 200;  ///< M0: prefixes that a subspace should hold.
    int reuse_windows = 1;      ///< J_max.
    double nominal_paths = 1;   ///< Light paths of the smallest cache that rendering will make.
    uint64_t seed = 0;
};

struct TrainingReport {
    GammaReport gamma;
    uint32_t light_subspaces = 0, eye_subspaces = 0;  ///< That there are; see SubspaceTables.
    uint64_t paths = 0, nodes = 0;
    uint64_t out_of_range = 0;  ///< Paths and light sub-paths that were left out; see TrainingData::in_range().
    double classifier_seconds = 0, energy_seconds = 0, gamma_seconds = 0;
    std::string note;  ///< One line when the tables are simpler than asked or data were left out; empty otherwise.
};

/// How others follow a training, and end it.
struct TrainingControl {
    std::stop_token stop;
    std::function<void(double)> progress;  ///< Optional; called now and then with the share of the time that has passed, about.
};

/// kCancelled within about a second of a stop request; otherwise always valid tables, whatever the data hold.
Result<SubspaceTables> train_tables(const TrainingData& data, const EmitterSet& emitters, const TrainingOptions& options,
                                    const TrainingControl& control, TrainingReport* report);

}  // namespace lightloom
