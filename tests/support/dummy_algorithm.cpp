// An algorithm in one file with one row of the catalog, which shows what it takes to add one. It traces paths with next
// event estimation, as `path` does, and its weights trust next event estimation more the brighter the frame was found
// to be. This serves no purpose, but the algorithm has a parameter of its own and learns a table of its own, and its
// mean is right whatever their values. A program that links this file has the algorithm in its catalog, and every suite
// that runs over the catalog tests it.

#include <cmath>
#include <cstring>

#include "common/transport/learning.h"
#include "common/transport/path.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {
namespace {

/// The learned table: the mean of the frame.
struct Brightness {
    double mean = 0;

    static const TablePart kPart;
};

std::string serialize_brightness(const void* part) {
    std::string bytes(sizeof(double), '\0');
    std::memcpy(bytes.data(), &static_cast<const Brightness*>(part)->mean, sizeof(double));
    return bytes;
}

Result<std::shared_ptr<const void>> parse_brightness(std::string_view bytes) {
    auto brightness = std::make_shared<Brightness>();
    if (bytes.size() != sizeof(double)) return data_loss("the brightness is not one number");
    std::memcpy(&brightness->mean, bytes.data(), sizeof(double));
    return std::shared_ptr<const void>(std::move(brightness));
}

Status validate_brightness(const void* part, const EmitterSet&) {
    const double mean = static_cast<const Brightness*>(part)->mean;
    if (std::isfinite(mean) && mean >= 0) return {};
    return data_loss("the brightness is negative or no number");
}

const TablePart Brightness::kPart{"brightness", serialize_brightness, parse_brightness, validate_brightness};

/// As PathSelection, except for how much next event estimation counts.
struct TrustingSelection {
    double trust = 1;

    struct OnPath : PathSelection::OnPath {
        double trust;
        double next_event() const { return trust * PathSelection::OnPath::next_event(); }
    };
    OnPath on(const PathView& view) const { return {PathSelection{}.on(view), trust}; }
    NextEventRays next_event_rays() const { return {}; }
};

constexpr ParameterInfo kParameters[] = {
    kRouletteStart,
    kRouletteMin,
    kHeuristic,
    {"trust", 1, 0.1, 10, false, "how much next event estimation counts"},
    {kTrainingPaths, 2000, 1, 1e8, true, "camera samples that measure the brightness"},
};
constexpr const TablePart* kParts[] = {&Brightness::kPart};

LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    return {.samples = samples, .rounds = {{samples}}};
}

Result<Tables> learn(const LearnRequest& r) {
    Brightness brightness;
    for (const double sum : r.data.block_sum) brightness.mean += sum / double(r.data.samples);
    return Tables(brightness);
}

constexpr LearningInfo kLearning{.parts = kParts, .plan = plan, .learn = learn};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& settings = r.settings.algorithm;
    const double trust = settings.value("trust") * (1 + std::min(r.tables.get<Brightness>()->mean, 10.0));
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(TrustingSelection{trust});
        return PathAlgorithm<std::remove_cvref_t<decltype(selection)>>{selection, heuristic_of(settings)};
    });
}

const AlgorithmInfo kDummyRow{
    .name = "dummy",
    .summary = "path tracing that trusts next event estimation by the brightness of the frame",
    .source = "own",
    .bias = "unbiased; misses what path misses",
    .parameters = kParameters,
    .traces = Traces::kCamera,
    .learning = &kLearning,
    .make = make,
};

[[maybe_unused]] const bool kAdded = [] {
    add_to_catalog(kDummyRow);
    return true;
}();

}  // namespace
}  // namespace lightloom
