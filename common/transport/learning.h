#pragma once
// How an algorithm learns its tables: the size of its training set, the rounds in which it is traced, and the tables
// that are learned from the data of a round. LearningInfo in a row of the catalog refers to these.

#include <cstdint>
#include <vector>

#include "common/path/corrected.h"
#include "common/path/next_event.h"
#include "common/tables/tables.h"
#include "common/tables/train.h"
#include "common/transport/settings.h"

namespace lightloom {

/// Camera samples of a training unit; the last one may have fewer.
inline constexpr uint64_t kTrainingUnitSamples = uint64_t(1) << 14;

/// Which part of the dataset a unit traces.
struct TrainingWork {
    uint64_t first_sample = 0;
    uint64_t sample_count = 0;
    uint64_t total_samples = 0;  ///< Samples of the whole dataset, which decide the size of the blocks.
    friend bool operator==(const TrainingWork&, const TrainingWork&) = default;
};

struct LearningRound {
    uint64_t samples = 0;
    bool guided = false;  ///< Traced with the tables of the round before it.
};

struct LearningPlan {
    uint64_t samples = 0;     ///< D: camera samples of all rounds.
    double energy_paths = 1;  ///< M' / D: light sub-paths that measure Q, per sample.
    std::vector<LearningRound> rounds;
    // Parameters of the render's weights that are not in the tables.
    ByDepth<int> connections;  ///< N
    Correction correction = Correction::kUncorrected;
    NextEventRays rays{0, 0};

    /// Samples of the rounds before this one.
    uint64_t first_sample(size_t round) const {
        uint64_t first = 0;
        for (size_t i = 0; i < round; ++i) first += rounds[i].samples;
        return first;
    }
    TrainingWork work(size_t round) const { return {first_sample(round), rounds[round].samples, samples}; }
    /// How many light sub-paths measure Q for all samples before number `sample`.
    uint64_t energy_paths_before(uint64_t sample) const;
};

struct LearnRequest {
    const TrainingData& data;  ///< The data of this round alone.
    size_t round = 0;
    const Tables& guide;  ///< The tables that guided the round; empty without a guide.
    const EmitterSet& emitters;
    const RenderSettings& settings;
    TrainingControl control;
    TrainingReport* report;
};

/// The plan of an algorithm that learns. Its rounds add up to its samples, and no round is empty.
LearningPlan learning_plan(const AlgorithmSettings& algorithm);
/// Learns the tables of one round and marks them as those of the algorithm.
Result<Tables> learn(const LearnRequest& request);

/// One round, or two if a pilot first traces `pilot_share` of the samples to guide the rest. The pilot consists of
/// whole units, so that units are planned alike in both rounds; a set that is too small for two rounds has one.
std::vector<LearningRound> rounds_with_pilot(uint64_t samples, double pilot_share);

}  // namespace lightloom
