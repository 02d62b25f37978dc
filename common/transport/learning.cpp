#include "common/transport/learning.h"

#include <algorithm>
#include <cmath>

namespace lightloom {

uint64_t LearningPlan::energy_paths_before(uint64_t sample) const { return uint64_t(std::ceil(double(sample) * energy_paths)); }

std::vector<LearningRound> rounds_with_pilot(uint64_t samples, double pilot_share) {
    const uint64_t units = samples / kTrainingUnitSamples;
    if (pilot_share <= 0 || units < 2) return {{samples}};
    const uint64_t pilot =
        kTrainingUnitSamples * std::clamp(uint64_t(std::llround(pilot_share * double(units))), uint64_t(1), units - 1);
    return {{pilot}, {samples - pilot, true}};
}

}  // namespace lightloom
