#include "common/transport/light.h"

#include "common/transport/learn_walks.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kLightRow;

namespace {

constexpr ParameterInfo kParameters[] = {kRouletteStart, kRouletteMin, emission_parameter(false), kEmissionTraining};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(LightSelection{});
        return LightAlgorithm<std::remove_cvref_t<decltype(selection)>>{selection};
    });
}

}  // namespace

const AlgorithmInfo kLightRow{
    .name = "light",
    .summary = "light tracing: light sub-paths connected to the lens",
    .source = "Dutre, Lafortune and Willems 1993",
    .bias = "unbiased; misses what the lens sees through mirrors and smooth glass",
    .parameters = kParameters,
    .traces = Traces::kLight,
    .light_paths_per_pixel = one_light_path,
    .learning = &kEmissionLearning,
    .make = make,
};

}  // namespace lightloom
