#include "common/transport/path.h"

#include "common/transport/learn_walks.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kPathRow;

namespace {

constexpr ParameterInfo kParameters[] = {
    kRouletteByAlbedo,
    kRouletteStart,
    kRouletteMinOfPath,
    kHeuristic,
    kNextEvent,
    kShadowRays,
    {kTrainingPaths, 50000, 1, 1e8, true,
     "camera samples of the training set from which roulette=learned learns; at most, where a job settles it"},
};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(PathSelection{next_event_of(r.settings.algorithm)});
        return PathAlgorithm<std::remove_cvref_t<decltype(selection)>>{selection, heuristic_of(r.settings.algorithm)};
    });
}

}  // namespace

const AlgorithmInfo kPathRow{
    .name = "path",
    .summary = "unidirectional path tracing with next event estimation",
    .source = "Kajiya 1986; Veach 1997, section 9.3",
    .bias = "unbiased; misses caustics of lights that cannot be hit",
    .parameters = kParameters,
    .traces = Traces::kCamera,
    .learning = &kGainLearning,
    .make = make,
};

}  // namespace lightloom
