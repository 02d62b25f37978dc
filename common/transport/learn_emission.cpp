#include "common/transport/learn_emission.h"

#include "common/tables/train_emission.h"
#include "common/transport/parameters.h"

namespace lightloom {
namespace {

constexpr const TablePart* kParts[] = {&EmissionPart::kPart};

bool wanted(const AlgorithmSettings& settings) { return learns_emission(settings); }

LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    return {.samples = samples, .energy_paths = 0, .rounds = growing_rounds(samples)};
}

Result<Tables> learn_table(const LearnRequest& request) {
    EmissionLesson lesson = learn_emission(request);
    if (request.control.stop.stop_requested()) return Status(StatusCode::kCancelled, "training was cancelled");
    request.report->paths = request.data.paths.size();
    return Tables(EmissionPart{std::move(lesson.data)});
}

}  // namespace

EmissionLesson learn_emission(const LearnRequest& r) {
    EmissionLesson lesson;
    if (!learns_emission(r.settings.algorithm)) return lesson;
    lesson.data = train_emission(r.data, block_brightness(r.data), r.emitters, r.control.stop);
    if (!lesson.data.learned()) return lesson;
    lesson.traced = lesson.rendered = r.emitters;
    lesson.traced->guide_emission(emission_of(r.guide));
    lesson.rendered->guide_emission(std::make_shared<const EmissionTable>(lesson.data));
    return lesson;
}

const LearningInfo kEmissionLearning{.parts = kParts, .plan = plan, .learn = learn_table, .wanted = wanted};

}  // namespace lightloom
