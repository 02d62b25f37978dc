#include "common/transport/learn_gain.h"

#include "common/tables/train_gain.h"
#include "common/transport/learn_emission.h"
#include "common/transport/parameters.h"

namespace lightloom {
namespace {

constexpr const TablePart* kGainParts[] = {&GainPart::kPart};
constexpr const TablePart* kBothParts[] = {&EmissionPart::kPart, &GainPart::kPart};

bool wants_gain(const AlgorithmSettings& s) { return learns_gain(s); }
bool wants_either(const AlgorithmSettings& s) { return learns_gain(s) || learns_emission(s); }

/// Emission guides a second round; gains do not.
LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    const bool guided = s.has(kEmission) && learns_emission(s);
    return {
        .samples = samples, .energy_paths = 0, .rounds = guided ? growing_rounds(samples) : std::vector<LearningRound>{{samples}}};
}

Status finish(const LearnRequest& request) {
    if (request.control.stop.stop_requested()) return {StatusCode::kCancelled, "training was cancelled"};
    request.report->paths = request.data.paths.size();
    return {};
}

Result<Tables> learn_gain_alone(const LearnRequest& request) {
    Tables tables(GainPart{learn_gain(request)});
    LL_RETURN_IF_ERROR(finish(request));
    return tables;
}

Result<Tables> learn_both(const LearnRequest& request) {
    Tables tables(EmissionPart{learn_emission(request).data});
    tables.set(std::make_shared<const GainPart>(GainPart{learn_gain(request)}));
    LL_RETURN_IF_ERROR(finish(request));
    return tables;
}

}  // namespace

GainData learn_gain(const LearnRequest& r) {
    if (!learns_gain(r.settings.algorithm)) return {};
    return train_gain(r.data, block_brightness(r.data), r.control.stop);
}

const LearningInfo kGainLearning{.parts = kGainParts, .plan = plan, .learn = learn_gain_alone, .wanted = wants_gain};
const LearningInfo kEmissionAndGainLearning{.parts = kBothParts, .plan = plan, .learn = learn_both, .wanted = wants_either};

}  // namespace lightloom
