#pragma once
// How much training a job can afford, and how much of it is worth its time. With a number of samples per pixel the answer
// is a function of the job alone, so that the same job always gives the same bytes. With a time limit it depends on a clock;
// it is then written into the job's spec before any unit of the image is leased, so that rendering that spec again
// gives the same bytes.
//
// The trade: a job's error at its end is proportional to loss / (time that is left for rendering), where the loss is what
// the tables have on paths that they have not seen [common/path/README.md, "Training set"]. A larger set is worth
// its time if it makes that quotient smaller. How the loss falls is measured while the set grows.

#include <cstdint>
#include <vector>

namespace lightloom {

/// Share of a time limit that preparation may take, unless the user chose the training set, where nothing tells what more
/// of it is worth.
inline constexpr double kTrainingShare = 0.1;
/// The largest share that it may take, however much it promises: half of a short job.
inline constexpr double kLongestShare = 0.5;
/// Seconds of a time limit below which it matters what learning costs at least. From there on a set that grows finds that out
/// itself, and the probe only measures tracing.
inline constexpr double kShortLimit = 10;
/// What a doubling of the set leaves of the loss, as long as nothing is measured (four interiors, up to kGuideSamples: 0.72
/// to 0.93).
inline constexpr double kTypicalLossPerDoubling = 0.8;
/// The gain of the next doublings relative to that of the measured ones (the same interiors: 0.75 to 1.4; the loss falls ever
/// more slowly, but the paths that judge are not wholly independent of those that train).
inline constexpr double kGainThatIsLeft = 0.9;
/// The gain of each of them relative to the one before it. The loss alone would say 0.8, but what else makes the noise is
/// left (veach-ajar: from 2^17 to 500000 samples the loss falls by 25 %, the noise by 4 to 7 %).
inline constexpr double kGainDecay = 0.6;
/// The share of the time to learn from kGuideSamples that grows in proportion to the samples (0.6 to 0.7).
inline constexpr double kLearningThatGrows = 0.65;
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

/// Samples of the image that take as long as tracing a sample of a set that grows and learning from it (four interiors,
/// 2^16 samples and more: 3.5 to 5).
inline constexpr double kTrainingSampleCost = 4;

/// The set of a job that renders `image_samples` camera samples: the largest power of two, or `wanted` itself, that takes no
/// longer than rendering them; at least kMinTrainingSamples.
uint64_t proportionate_training_samples(uint64_t image_samples, uint64_t wanted);

struct TrainingRate {
    double trace_seconds_per_sample = 0;  ///< With all workers together.
    double learn_seconds_per_sample = 0;  ///< On the coordinator.
};

/// A set to which the present one may grow.
struct LargerSet {
    uint64_t samples = 0;
    double seconds = 0;  ///< From now until its tables exist.
};

/// The set that makes the error of the job the smallest: one of the larger ones, or the present one, whose tables exist.
/// `loss_per_doubling` is that of the next doubling, see kGainDecay; `limit` and `left` are the job's time, in seconds; no set
/// leaves less than a share of 1 - kLongestShare for rendering.
uint64_t best_training_size(uint64_t present, const std::vector<LargerSet>& sets, double loss_per_doubling, double limit,
                            double left);

/// What the next doubling of the set will leave of the loss, where it fell from `before` to `now` in `doublings` of
/// them, on the same paths. kTypicalLossPerDoubling if the losses say nothing.
double expected_loss_per_doubling(double now, double before, double doublings);

/// The largest power of two whose training fits into `seconds`, between kMinTrainingSamples and `wanted`; `wanted`
/// itself if the budget has room for it. Powers of two let jobs with similar limits share their tables.
uint64_t affordable_training_samples(const TrainingRate& rate, double seconds, uint64_t wanted);

}  // namespace lightloom
