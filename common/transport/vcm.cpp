#include "common/transport/vcm.h"

#include "common/core/usable_memory.h"
#include "common/tables/density_part.h"
#include "common/tables/train_density.h"
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

constexpr ParameterInfo kParameters[] = {kRouletteByAlbedo,
                                         kRouletteStart,
                                         kRouletteMin,
                                         heuristic_parameter(HeuristicChoice::kCorrelationAware, 8),
                                         kTechniquesOfMerging,
                                         kNextEvent,
                                         kShadowRays,
                                         kConnectionsToPhotonPaths,
                                         kPhotonPaths,
                                         kMergeRadius,
                                         kMergeRadiusUnit,
                                         kAlpha,
                                         kMergeFirst,
                                         kKernel,
                                         emission_parameter(false),
                                         kEmissionTraining};

constexpr const TablePart* kParts[] = {&EmissionPart::kPart, &GainPart::kPart, &DensityPart::kPart};

bool wanted(const AlgorithmSettings& s) { return learns_density(s) || kWalkLearning.wanted(s); }

/// As many light sub-paths are kept for the density map as there are camera samples.
LearningPlan plan(const AlgorithmSettings& s) {
    LearningPlan plan = kWalkLearning.plan(s);
    if (learns_density(s)) plan.energy_paths = 1;
    return plan;
}

Result<Tables> learn(const LearnRequest& r) {
    auto tables = kWalkLearning.learn(r);
    if (!tables.ok()) return tables.status();
    DensityData density;
    if (learns_density(r.settings.algorithm)) {
        density = train_density(r.data);
        if (!density.learned())
            r.report->add_note("no light sub-path left a photon; heuristic=vcm+ and vcm* weight merges as if discs held one each");
    }
    tables->set(std::make_shared<const DensityPart>(DensityPart{std::move(density)}));
    return tables;
}

Status check_techniques(const AlgorithmSettings& s) {
    const HeuristicChoice choice = heuristic_choice_of(s);
    const std::string techniques(kTechniqueSets[int(s.value(kTechniques.name))]);
    if (choice < HeuristicChoice::kJendersie19 || techniques != "no-merge") return {};
    return invalid_argument("heuristic=" + std::string(kHeuristicNames[int(choice)]) +
                            " of 'vcm' weights merges, of which techniques=no-merge leaves none; choose balance");
}

constexpr LearningInfo kLearning{.parts = kParts, .plan = plan, .learn = learn, .wanted = wanted};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& s = r.settings.algorithm;
    LL_RETURN_IF_ERROR(check_photon_memory(r, r.light_paths_per_iteration(), usable_memory()));
    const VcmSelection first{
        {{double(r.light_paths_per_iteration()), next_event_of(s)}, s.value_by_depth(kConnectionsToPhotonPaths.name)},
        merge_radius_of(s, *r.scene),
        MergeKernel(int(s.value(kKernel.name))),
        s.value(kMergeFirst.name) != 0,
        correction_of(s)};
    const auto density = density_of(r.tables);
    return make_unit_renderer(r, [&](auto&& select) {
        return VcmAlgorithm<std::remove_cvref_t<decltype(select)>>{select, first, s.value(kAlpha.name), heuristic_of(s), density};
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
    .learning = &kLearning,
    .make = make,
    .check = check_techniques,
};

}  // namespace lightloom
