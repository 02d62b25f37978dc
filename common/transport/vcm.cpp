#include "common/transport/vcm.h"

#include "common/transport/learn_walks.h"
#include "common/transport/merging_parameters.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kVcmRow;

namespace {

// The first is the sub-path that the camera sample would own in bdpt.
constexpr ParameterInfo kConnectionsToPhotonPaths{
    "connections", 1, 1, 64, true, "N: light sub-paths whose vertices a camera vertex is connected to", {}, true};
constexpr ParameterInfo kPhotonPaths{
    "light-paths",
    1,
    0.001,
    64,
    false,
    "N1 and n: light sub-paths per pixel and iteration; all of them splat, all of their vertices are "
    "photons"};

constexpr std::string_view kCounts[] = {"off", "on", "one"};
constexpr ParameterInfo kCorrelationAware{"correlation-aware",
                                          1,
                                          0,
                                          2,
                                          true,
                                          "weights know that all merges of a camera sub-path share it [Grittmann et al. 2021]; "
                                          "one: they count as one [Popov et al. 2015]",
                                          kCounts};

constexpr ParameterInfo kParameters[] = {kRouletteByAlbedo,    kRouletteStart, kRouletteMin,      kHeuristic,
                                         kTechniquesOfMerging, kNextEvent,     kShadowRays,       kConnectionsToPhotonPaths,
                                         kPhotonPaths,         kMergeRadius,   kMergeRadiusUnit,  kAlpha,
                                         kMergeFirst,          kKernel,        kCorrelationAware, emission_parameter(false),
                                         kEmissionTraining};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& s = r.settings.algorithm;
    LL_RETURN_IF_ERROR(check_photon_memory(r, r.light_paths_per_iteration(), usable_memory()));
    const VcmSelection first{{double(r.light_paths_per_iteration()), next_event_of(s)},
                             merge_radius_of(s, *r.scene),
                             MergeKernel(int(s.value(kKernel.name))),
                             s.value(kMergeFirst.name) != 0,
                             MergeCount(int(s.value(kCorrelationAware.name))),
                             s.value_by_depth(kConnectionsToPhotonPaths.name)};
    return make_unit_renderer(r, [&](auto&& select) {
        return VcmAlgorithm<std::remove_cvref_t<decltype(select)>>{select, first, s.value(kAlpha.name), heuristic_of(s)};
    });
}

}  // namespace

const AlgorithmInfo kVcmRow{
    .name = "vcm",
    .summary = "bidirectional path tracing whose light sub-paths are photons as well: finds caustics in mirrors",
    .source = "Georgiev, Krivanek, Davidovic and Slusallek 2012",
    .bias = "merges blur over a radius that shrinks; misses nothing that has a diffuse or glossy vertex",
    .merges = true,
    .parameters = kParameters,
    .frame = FrameShape::kWhole,
    .light_paths_per_pixel = chosen_light_paths,
    .shares_light_paths = true,
    .learning = &kWalkLearning,
    .make = make,
};

}  // namespace lightloom
