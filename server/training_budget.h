#pragma once
// How much training a time-limited job can afford. The answer depends on a clock; it is therefore written into the
// job's spec before any unit that depends on it is leased, so that rendering that spec again gives the same bytes.

#include <cstdint>

namespace lightloom {

/// Share of a time limit that preparation may take unless the user chose the training set.
inline constexpr double kTrainingShare = 0.1;
/// Least samples of the probe unit, which are thrown away afterwards; there are more where the limit has room, because
/// a small probe tells little. Workers trace a part of the probe untimed first (worker.cpp), outside of kTrainingShare,
/// so that the one-time costs of a cold worker do not count.
inline constexpr uint64_t kProbeSamples = 2048;
inline constexpr double kProbeSamplesPerSecond = 300;  ///< Per second of the time limit.
/// Below this, tables are worth less than what they cost to learn.
inline constexpr uint64_t kMinTrainingSamples = 1024;
/// Cost of a sample of a set that is traced in two rounds, relative to one of the probe: subspace connections find more
/// paths, and all of them are used for learning.
inline constexpr double kGuidedCost = 2;
/// Time for which the coordinator learns from a sample, mostly on one thread, relative to the processor time of tracing
/// it. The probe cannot measure this: most of its own learning does not depend on the number of samples, and is counted
/// separately. (Difficult interiors: 0.3 to 0.45 of tracing in two rounds.)
inline constexpr double kLearningOverTracing = 0.35;

struct TrainingRate {
    double trace_seconds_per_sample = 0;  ///< With all workers together.
    double learn_seconds_per_sample = 0;  ///< On the coordinator.
};

/// The largest power of two whose training fits into `seconds`, between kMinTrainingSamples and `wanted`; `wanted`
/// itself if the budget has room for it. Powers of two let jobs with similar limits share their tables.
uint64_t affordable_training_samples(const TrainingRate& rate, double seconds, uint64_t wanted);

}  // namespace lightloom
