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
    uint64_t total_samples = 0;  ///< Samples of the whole dataset, as far as it is decided. For reports of progress.
    friend bool operator==(const TrainingWork&, const TrainingWork&) = default;
};

struct LearningRound {
    uint64_t samples = 0;
    /// Traced with the tables of the round before it. Tables are learned from the data of a round together with those of
    /// the guided rounds just before it; paths that no guide found have the larger variance and would outweigh them.
    bool guided = false;
};

struct LearningPlan {
    uint64_t samples = 0;     ///< D: camera samples of all rounds.
    double energy_paths = 1;  ///< M' / D: light sub-paths that measure Q, per sample.
    std::vector<LearningRound> rounds;
    bool grows = false;  ///< The rounds are those of growing_rounds().
    /// What the tables are learned from: full paths, and visits (for the gain table).
    bool keeps_paths = true, keeps_visits = false;
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
    const TrainingData& data;  ///< The data of this round and of the guided rounds before it, see LearningRound.
    size_t round = 0;
    const Tables& guide;  ///< The tables that guided the round; empty without a guide.
    const EmitterSet& emitters;
    const RenderSettings& settings;
    TrainingControl control;
    TrainingReport* report;
    bool judges_guide = false;  ///< Whether TrainingReport::judged_loss is wanted of the guide.
};

/// The plan of an algorithm that learns. Its rounds add up to its samples, and no round is empty.
LearningPlan learning_plan(const AlgorithmSettings& algorithm);
/// Learns the tables of one round and marks them as those of the algorithm.
Result<Tables> learn(const LearnRequest& request);

/// Sizes at which a set that grows has tables before it is complete. Units are whole in all rounds but the last one.
inline constexpr uint64_t kPilotSamples = kTrainingUnitSamples, kGuideSamples = 4 * kPilotSamples;

/// The rounds of a set that may still grow while it is traced: a pilot; from twice its size on, a round that it guides;
/// from 2 kGuideSamples on, another one, guided by the tables of the first kGuideSamples. The rounds before the last are
/// those of every larger set, too.
std::vector<LearningRound> growing_rounds(uint64_t samples);
/// The sizes to which such a set may grow, ascending, after the round that ended with `samples`; none above `most`.
std::vector<uint64_t> larger_sets(uint64_t samples, uint64_t most);

}  // namespace lightloom
