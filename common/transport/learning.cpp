#include "common/transport/learning.h"

#include <algorithm>
#include <cmath>

#include "common/core/check.h"

namespace lightloom {

uint64_t LearningPlan::energy_paths_before(uint64_t sample) const { return uint64_t(std::ceil(double(sample) * energy_paths)); }

LearningPlan learning_plan(const AlgorithmSettings& algorithm) {
    LearningPlan plan = algorithm.learning()->plan(algorithm);
    LL_CHECK(!plan.rounds.empty());
    for (const LearningRound& round : plan.rounds) LL_CHECK_GT(round.samples, uint64_t(0));
    LL_CHECK_EQ(plan.first_sample(plan.rounds.size()), plan.samples);
    return plan;
}

Result<Tables> learn(const LearnRequest& request) {
    const AlgorithmInfo& info = request.settings.algorithm.info();
    auto tables = info.learning->learn(request);
    if (tables.ok()) tables->belong_to(std::string(info.name));
    return tables;
}

std::vector<LearningRound> rounds_with_pilot(uint64_t samples, double pilot_share) {
    const uint64_t units = samples / kTrainingUnitSamples;
    if (pilot_share <= 0 || units < 2) return {{samples}};
    const uint64_t pilot =
        kTrainingUnitSamples * std::clamp(uint64_t(std::llround(pilot_share * double(units))), uint64_t(1), units - 1);
    return {{pilot}, {samples - pilot, true}};
}

}  // namespace lightloom
