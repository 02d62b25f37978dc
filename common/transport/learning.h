#pragma once
// How an algorithm learns its tables: the size of its training set, the rounds in which that is traced, and what tables come of the
// data of a round. A row of the catalog answers with these (LearningInfo).

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
    uint64_t total_samples = 0;  ///< Of the whole dataset: sets the size of the blocks.
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
    // How the weights of the render will count, where no table decides that.
    int connections = 1;  ///< N
    Correction correction = Correction::kUncorrected;
    NextEventRays rays{0, 0};

    /// Samples of the rounds before this one.
    uint64_t first_sample(size_t round) const {
        uint64_t first = 0;
        for (size_t i = 0; i < round; ++i) first += rounds[i].samples;
        return first;
    }
    TrainingWork work(size_t round) const { return {first_sample(round), rounds[round].samples, samples}; }
    /// How many light sub-paths the samples before number `sample` measure Q with.
    uint64_t energy_paths_before(uint64_t sample) const;
};

struct LearnRequest {
    const TrainingData& data;  ///< Of one round alone.
    size_t round = 0;
    const Tables& guide;  ///< Of the round before; empty for the first.
    const EmitterSet& emitters;
    const RenderSettings& settings;
    TrainingControl control;
    TrainingReport* report;
};

/// Of an algorithm that learns. Its rounds make up its samples, and none is empty.
LearningPlan learning_plan(const AlgorithmSettings& algorithm);
/// The tables of one round, marked as those of the algorithm.
Result<Tables> learn(const LearnRequest& request);

/// One round, or two if a pilot traces `pilot_share` of the samples first to guide the rest. Rounds are whole units, so that both
/// are planned alike; one round where the set is too small for two.
std::vector<LearningRound> rounds_with_pilot(uint64_t samples, double pilot_share);

}  // namespace lightloom
