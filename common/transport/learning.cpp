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

std::vector<LearningRound> growing_rounds(uint64_t samples) {
    if (samples < 2 * kPilotSamples) return {{samples}};
    if (samples < 2 * kGuideSamples) return {{kPilotSamples}, {samples - kPilotSamples, true}};
    return {{kPilotSamples}, {kGuideSamples - kPilotSamples, true}, {samples - kGuideSamples, true}};
}

std::vector<uint64_t> larger_sets(uint64_t samples, uint64_t most) {
    std::vector<uint64_t> sizes;
    if (samples == kPilotSamples) {
        for (uint64_t n = 2 * samples; n <= std::min(most, kGuideSamples); n *= 2) sizes.push_back(n);
    } else if (samples == kGuideSamples && most >= 2 * samples) {
        for (uint64_t n = 2 * samples; n < most; n *= 2) sizes.push_back(n);
        sizes.push_back(most);
    }
    return sizes;
}

}  // namespace lightloom
