#include "common/transport/vcm.h"

#include "common/tables/density_part.h"
#include "common/tables/train_density.h"
#include "common/transport/learn_walks.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kVcmRow;

namespace {

constexpr std::string_view kRadiusUnits[] = {"pixel", "scene"};
constexpr std::string_view kKernels[] = {"constant", "epanechnikov"};

// One pixel is the footprint of Georgiev et al.'s and Grittmann et al.'s programs, too.
constexpr ParameterInfo kMergeRadius{
    "merge-radius", 1,     1e-3,
    1000,           false, "radius of merges in the first iteration, in the unit of merge-radius-unit [Georgiev et al. 2012]"};
constexpr ParameterInfo kMergeRadiusUnit{"merge-radius-unit",
                                         0,
                                         0,
                                         1,
                                         true,
                                         "pixel: the width of a pixel where the camera sub-path first meets something that is "
                                         "neither mirror nor glass; scene: a thousandth of the radius of the scene",
                                         kRadiusUnits};
constexpr ParameterInfo kAlpha{
    "alpha",
    0.75,
    0.01,
    1,
    false,
    "how the radius shrinks: its square is in proportion to the number of the iteration to the power of alpha - 1; 1 keeps "
    "it as it is [Knaus and Zwicker 2011]"};
constexpr ParameterInfo kMergeFirst{
    "merge-first",
    0,
    0,
    1,
    true,
    "merge at the camera's first hit, too, where light tracing finds the same light without bias [off in Grittmann et al. 2021]",
    kSwitch};
constexpr ParameterInfo kKernel{"kernel", 0, 0, 1, true, "weight of a photon by its distance from the camera vertex", kKernels};
constexpr ParameterInfo kPhotonPaths{
    "light-paths",
    1,
    0.001,
    64,
    false,
    "N1 and n: light sub-paths per pixel and iteration; all of them splat, all of their vertices are "
    "photons, and every camera sample is connected to one of them"};

constexpr ParameterInfo kParameters[] = {
    kRouletteByAlbedo,         kRouletteStart,   kRouletteMin, heuristic_parameter(HeuristicChoice::kCorrelationAware, 8),
    kTechniquesOfMerging,      kNextEvent,       kPhotonPaths, kMergeRadius,
    kMergeRadiusUnit,          kAlpha,           kMergeFirst,  kKernel,
    emission_parameter(false), kEmissionTraining};

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

MergeRadius radius_of(const AlgorithmSettings& s, const Scene& scene) {
    const double value = s.value(kMergeRadius.name), scene_radius = double(scene.emitters().scene_radius());
    MergeRadius radius{.most2 = scene_radius * scene_radius};
    const FrameLayout& frame = scene.frame();
    if (s.value(kMergeRadiusUnit.name) != 0) {
        radius.fixed2 = value * value * radius.most2 * 1e-6;
        return radius;
    }
    const float centre_density =
        scene.camera().sample_ray({0.5f * float(frame.width), 0.5f * float(frame.height)}, {0.5f, 0.5f}).pdf;
    (scene.camera().has_parallel_rays() ? radius.fixed2 : radius.per_distance2) = value * value / double(centre_density);
    return radius;
}

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& s = r.settings.algorithm;
    const VcmSelection first{{double(r.light_paths_per_iteration()), next_event_of(s)},
                             radius_of(s, *r.scene),
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
