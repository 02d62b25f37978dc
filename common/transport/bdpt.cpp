#include "common/transport/bdpt.h"

#include "common/transport/learn_walks.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kBdptRow;

namespace {

constexpr ParameterInfo kParameters[] = {kRouletteByAlbedo, kRouletteStart, kRouletteMin, kHeuristicOfSharing,
                                         kTechniques,       kNextEvent,     kShadowRays,  emission_parameter(false),
                                         kEmissionTraining};

constexpr AbsentParameter kAbsent[] = {
    {"connections",
     "every camera vertex is connected to all vertices of the one light sub-path of its sample; vcm connects to several"}};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& settings = r.settings.algorithm;
    return make_corrected(BdptSelection{double(r.light_paths_per_iteration()), next_event_of(settings)}, correction_of(settings),
                          [&](const auto& densities) {
                              return make_unit_renderer(r, [&](auto&& select) {
                                  const auto selection = select(densities);
                                  return BdptAlgorithm<std::remove_cvref_t<decltype(selection)>>{selection, heuristic_of(settings)};
                              });
                          });
}

}  // namespace

const AlgorithmInfo kBdptRow{
    .name = "bdpt",
    .summary = "bidirectional path tracing, every camera sample paired with one light sub-path",
    .source = "Veach 1997, chapter 10",
    .bias = "unbiased; misses specular-diffuse-specular paths from lights that cannot be hit",
    .parameters = kParameters,
    .absent = kAbsent,
    .light_paths_per_pixel = one_light_path,
    .learning = &kWalkLearning,
    .make = make,
};

}  // namespace lightloom
