#include "server/training_budget.h"

namespace lightloom {

uint64_t affordable_training_samples(const TrainingRate& rate, double seconds, uint64_t wanted) {
    const auto fits = [&](uint64_t samples) {
        return double(samples) * (rate.trace_seconds_per_sample + rate.learn_seconds_per_sample) <= seconds;
    };
    if (wanted <= kMinTrainingSamples || fits(wanted)) return wanted;
    uint64_t samples = kMinTrainingSamples;
    while (2 * samples < wanted && fits(2 * samples)) samples *= 2;
    return samples;
}

}  // namespace lightloom
