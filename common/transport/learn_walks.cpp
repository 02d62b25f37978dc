#include "common/transport/learn_walks.h"

#include "common/core/stopwatch.h"
#include "common/tables/train_emission.h"
#include "common/tables/train_gain.h"
#include "common/transport/parameters.h"

namespace lightloom {
namespace {

constexpr const TablePart* kEmissionParts[] = {&EmissionPart::kPart};
constexpr const TablePart* kGainParts[] = {&GainPart::kPart};
constexpr const TablePart* kBothParts[] = {&EmissionPart::kPart, &GainPart::kPart};

bool wanted(const AlgorithmSettings& s) { return learns_emission(s) || learns_gain(s); }

/// Emission guides further rounds; gains do not.
LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    return {.samples = samples,
            .energy_paths = 0,
            .rounds = learns_emission(s) ? growing_rounds(samples) : std::vector<LearningRound>{{samples}},
            .keeps_paths = learns_emission(s),
            .keeps_visits = learns_gain(s)};
}

Result<Tables> learn_walks(const LearnRequest& request) {
    WalkLessons lessons(request);
    if (request.control.stop.stop_requested()) return Status(StatusCode::kCancelled, "training was cancelled");
    request.report->paths = request.data.paths.size();
    Tables tables;
    lessons.move_to(&tables);
    return tables;
}

}  // namespace

WalkLessons::WalkLessons(const LearnRequest& r) : request_(r) {
    Stopwatch watch;
    const AlgorithmSettings& settings = r.settings.algorithm;
    if (!wanted(settings)) return;
    const std::vector<double> brightness = block_brightness(r.data);
    if (learns_emission(settings)) emission_ = train_emission(r.data, brightness, r.emitters, r.control.stop);
    if (learns_gain(settings)) gain_ = train_gain(r.data, brightness, r.control.stop);
    if (emission_.learned()) {
        traced_ = rendered_ = r.emitters;
        traced_->guide_emission(emission_of(r.guide));
        rendered_->guide_emission(std::make_shared<const EmissionTable>(emission_));
    }
    seconds_ = watch.lap();
}

void WalkLessons::move_to(Tables* tables) {
    const AlgorithmSettings& settings = request_.settings.algorithm;
    TrainingReport& report = *request_.report;
    report.classifier_seconds += seconds_;
    if (learns_emission(settings) && !emission_.learned())
        report.add_note("nothing was found to tell how light should leave the lights; it leaves in proportion to power");
    if (learns_gain(settings) && !gain_.learned()) report.add_note("no camera sub-path found light; roulette goes by power");
    for (const TablePart* part : settings.info().learning->parts) {
        if (part == &EmissionPart::kPart) tables->set(std::make_shared<const EmissionPart>(EmissionPart{std::move(emission_)}));
        if (part == &GainPart::kPart) tables->set(std::make_shared<const GainPart>(GainPart{std::move(gain_)}));
    }
}

const LearningInfo kEmissionLearning{.parts = kEmissionParts, .plan = plan, .learn = learn_walks, .wanted = wanted};
const LearningInfo kGainLearning{.parts = kGainParts, .plan = plan, .learn = learn_walks, .wanted = wanted};
const LearningInfo kWalkLearning{.parts = kBothParts, .plan = plan, .learn = learn_walks, .wanted = wanted};

}  // namespace lightloom
