#include "server/training_budget.h"

#include <algorithm>
#include <cmath>

namespace lightloom {

uint64_t best_training_size(uint64_t present, const std::vector<LargerSet>& sets, double loss_per_doubling, double limit,
                            double left) {
    if (!(left > 0)) return present;
    uint64_t best = present;
    double least = 1 / left;
    for (const LargerSet& set : sets) {
        const double rest = left - set.seconds;
        if (!(rest >= (1 - kLongestShare) * limit)) continue;
        double loss = 1, gain = 1 - loss_per_doubling;
        for (double doublings = std::log2(double(set.samples) / double(present)); doublings > 0; doublings -= 1, gain *= kGainDecay)
            loss *= std::pow(1 - gain, std::min(doublings, 1.0));
        const double error = loss / rest;
        if (error < least) least = error, best = set.samples;
    }
    return best;
}

double expected_loss_per_doubling(double now, double before, double doublings) {
    if (!(now > 0 && before > 0) || !std::isfinite(now) || !std::isfinite(before)) return kTypicalLossPerDoubling;
    const double measured = std::pow(std::min(1.0, now / before), 1 / doublings);
    return 1 - kGainThatIsLeft * (1 - measured);
}

uint64_t proportionate_training_samples(uint64_t image_samples, uint64_t wanted) {
    return affordable_training_samples({.trace_seconds_per_sample = kTrainingSampleCost}, double(image_samples), wanted);
}

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
