#pragma once
// How much training a time-limited job can afford. The answer comes from a clock, so it is written into the job's spec before any
// unit that depends on it is leased; whoever renders that spec again gets the same bytes.

#include <cstdint>

namespace lightloom {

/// Share of a time limit that preparation may take unless the user chose the training set.
inline constexpr double kTrainingShare = 0.1;
/// Samples of the unit that measures, thrown away afterwards: at least so many, and more where the limit has room, because a
/// small probe tells little. Workers trace a part of it untimed first (worker.cpp), beyond kTrainingShare: whatever a cold worker
/// does first takes that time.
inline constexpr uint64_t kProbeSamples = 2048;
inline constexpr double kProbeSamplesPerSecond = 300;  ///< Of the time limit.
/// Below this, tables are worth less than what they cost to learn.
inline constexpr uint64_t kMinTrainingSamples = 1024;
/// What a sample of a set that is traced in two rounds costs, over one of the probe: subspace connections find more paths,
/// and all of them are learned from.
inline constexpr double kGuidedCost = 2;
/// What learning from a sample costs the coordinator, which does most of it on one thread, over the processor time that tracing it
/// costs. The probe cannot tell: most of its own learning does not depend on the number of samples, and counts as such. (Hard
/// interiors: 0.3 to 0.45 of tracing in two rounds.)
inline constexpr double kLearningOverTracing = 0.35;

struct TrainingRate {
    double trace_seconds_per_sample = 0;  ///< With all workers at once.
    double learn_seconds_per_sample = 0;  ///< Of the coordinator.
};

/// The largest power of two whose training fits into `seconds`, between kMinTrainingSamples and `wanted` (which is also
/// what comes of a budget that has room for it). Powers of two, so that jobs with similar limits can share their tables.
uint64_t affordable_training_samples(const TrainingRate& rate, double seconds, uint64_t wanted);

}  // namespace lightloom
