#pragma once
// Learns tables from training data: brightness of blocks, kappa, Q, Gamma, windows. [Su, Li and Wang 2022, section 7]
//
// The dataset is cleaned for training only (no image is made of it). A path without a connectible edge teaches Gamma
// nothing and is left out, as is a path whose numbers left the range of single precision (these are counted). w_X is
// cut at its 99 % quantile, so that one lucky path does not own a column; for the choice of centroids, contributions
// are cut at their 99.9 % quantile.

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>

#include "common/core/by_depth.h"
#include "common/core/result.h"
#include "common/tables/subspace_tables.h"
#include "common/tables/train_gamma.h"
#include "common/tables/training_data.h"

namespace lightloom {

struct TrainingOptions {
    uint32_t light_subspaces = 1000, eye_subspaces = 1000;  ///< N_L, N_E: upper bounds.
    double source_share = 0.2;                              ///< At most this share of N_L is for points on lights.
    double direction_weight = 0.05;                         ///< k_d.
    double mix = 0.1;                                       ///< Conservative share of Gamma; see train_gamma.h.
    GammaTrainer trainer = GammaTrainer::kMm;
    ByDepth<int> connections = 3;  ///< N, the number of connections that rendering will make.
    double reuse_target = 200;     ///< M0: prefixes that a subspace should hold.
    int reuse_windows = 1;         ///< J_max.
    double nominal_paths = 1;      ///< Light paths of the smallest cache that rendering will make.
    /// How light left the lights where the data were traced (those of the last round, if there are several), and how it
    /// will in the render; null: both alike.
    const EmitterSet* traced = nullptr;
    const EmitterSet* rendered = nullptr;
    uint64_t seed = 0;
    const SubspaceTables* judged = nullptr;  ///< Other tables of the scene, for TrainingReport::judged_loss.
};

struct TrainingReport {
    GammaReport gamma;
    /// Loss of TrainingOptions::judged on the paths whose loss of the result is `gamma.loss` (trainer mm): what both have
    /// not been trained with. 0 if there is nothing to judge.
    double judged_loss = 0;
    uint32_t light_subspaces = 0, eye_subspaces = 0;  ///< Subspaces in the tables; at most as many as asked for.
    uint64_t paths = 0, nodes = 0;
    uint64_t out_of_range = 0;  ///< Paths and light sub-paths that were left out; see TrainingData::in_range().
    double classifier_seconds = 0, energy_seconds = 0, gamma_seconds = 0;
    std::string note;  ///< One line when the tables are simpler than asked or data were left out; empty otherwise.

    void add_note(std::string_view more) {
        if (!note.empty()) note += "; ";
        note += more;
    }
};

/// Lets the caller follow a training and end it.
struct TrainingControl {
    std::stop_token stop;
    std::function<void(double)> progress;  ///< Optional; called now and then with the approximate share of time passed.
    /// Optional; called when the data are needed no more, while most of the training is still to come, so that their owner
    /// may free them.
    std::function<void()> data_read;
};

/// Brightness of every block: its mean estimate, smoothed, plus a tenth of the frame's mean. Blocks are joined until one
/// has about 200 samples, and then smoothed over 3 x 3.
std::vector<double> block_brightness(const TrainingData& data);

/// Returns kCancelled within about a second of a stop request, and otherwise valid tables, whatever the data hold.
Result<SubspaceTables> train_tables(const TrainingData& data, const EmitterSet& emitters, const TrainingOptions& options,
                                    const TrainingControl& control, TrainingReport* report);

}  // namespace lightloom
