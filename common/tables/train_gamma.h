#pragma once
// Learns Gamma: for every eye subspace a distribution over light subspaces that minimises the MIS-aware bound of the variance,
//     loss(Gamma) = sum_X w_X / F_X,   F_X = fixed_X + sum_n g_n Gamma(i_n, j_n)     [Su, Li and Wang 2022, Eq. 14-16]
// over the paths X of a dataset. Three trainers:
//   mm            majorise-minimise with a prior from coarser subspaces, its strength chosen on held-out paths
//                 [common/path/README.md, "Trainer"]
//   adam          stochastic gradient on softmax columns, as the paper does
//   contribution  share of contribution, blind to the other techniques (the paper's Fig. 6 ablation)
// All are deterministic. Gamma = (1 - mix) B + mix (uniform + Q-proportional) / 2; the loss includes the mix.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

namespace lightloom {

/// A connection that can make a path: its subspaces, and g_n of the loss.
struct GammaNode {
    uint16_t light = 0, eye = 0;
    float g = 0;
};

struct GammaPath {
    uint32_t first_node = 0, node_count = 0;
    float weight = 0;        ///< w_X: TrainingPath::square over the block's squared brightness, cut at a quantile.
    float fixed = 0;         ///< fixed_X: density of the techniques that Gamma does not change.
    float contribution = 0;  ///< Estimate relative to the block's brightness.
    uint32_t batch = 0;      ///< Paths of one batch share light sub-paths: they are not independent.
    uint32_t sample = 0;     ///< Paths of one sample share a camera sub-path; they are neighbours in the dataset.
};

struct GammaDataset {
    uint32_t light_count = 1, eye_count = 1;
    uint32_t source_count = 0;  ///< Light labels below this are cells of emitters; they are coarsened separately.
    std::vector<GammaNode> nodes;
    std::vector<GammaPath> paths;
    std::vector<float> energy;  ///< Q, positive.
};

enum class GammaTrainer : uint8_t { kMm, kAdam, kContribution };

struct GammaOptions {
    GammaTrainer trainer = GammaTrainer::kMm;
    double mix = 0.1;
    double held_out = 0.2;  ///< Share of the batches (of camera samples where they are few) that only judge (mm).
    uint64_t seed = 0;
    std::stop_token stop;                  ///< After a stop request the function returns soon, with a matrix of no use.
    std::function<void(double)> progress;  ///< Optional; called now and then with the share of the work that is done.
};

/// Results of the training, for reports.
struct GammaReport {
    double uniform_loss = 0;  ///< Loss of the prior (half uniform, half by Q) on the held-out paths (mm) or all.
    double loss = 0;          ///< Loss of the result on the same paths.
    double prior_strength = 0;
    uint32_t light_resolution = 1, eye_resolution = 1;  ///< Subspaces that the result tells apart (mm).
};

/// Returns Gamma, column-major (eye * light_count + light); every column sums to one, every entry is positive.
std::vector<float> train_gamma(const GammaDataset& data, const GammaOptions& options, GammaReport* report);

/// The loss of any Gamma over the paths of a dataset that only judge where the trainer is mm.
double held_out_loss(const GammaDataset& data, const std::vector<float>& gamma, const GammaOptions& options);

/// The loss of a Gamma over the paths first, first + stride, ... of a dataset, divided by their number.
double gamma_loss(const GammaDataset& data, const std::vector<float>& gamma, size_t first = 0, size_t stride = 1);

}  // namespace lightloom
