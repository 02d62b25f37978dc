#include "common/transport/spcbpt.h"

#include "common/transport/learn_walks.h"
#include "common/transport/merging_parameters.h"
#include "common/transport/spcbpt_merging.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kSpcbptRow;

namespace {

constexpr std::string_view kTrainers[] = {"mm", "adam", "contribution"};

constexpr ParameterInfo kParameters[] = {
    kRouletteByAlbedo,
    kRouletteStart,
    kRouletteMin,
    heuristic_parameter(HeuristicChoice::kCorrelationAware, 5),
    kTechniques,
    kNextEventBesideCache,
    kShadowRaysBesideCache,
    kLightPaths,
    kCache,
    kConnections,
    emission_parameter(true),
    {"light-subspaces", 1000, 1, 16384, true, "N_L: upper bound of the light subspaces [Su et al. 2022, section 8.1]"},
    {"eye-subspaces", 1000, 1, 16384, true, "N_E: upper bound of the eye subspaces [Su et al. 2022, section 8.1]"},
    {"source-share", 0.2, 0, 1, false, "share of N_L that divides the lights themselves, at most [Su et al. 2022, section 7.2.1]"},
    {kTrainingPaths, 500000, 1, 1e8, true,
     "D: camera samples of the training set, each with a light sub-path; at most, where a job settles it [Su et al. 2022: 1e6]"},
    {"energy-paths", 1, 0.01, 16, false,
     "M' over D: light sub-paths that measure Q, per camera sample of the training set [Su et al. 2022: 2]"},
    {"pilot", 1, 0, 1, true,
     "the first paths of the training set, which nothing guides, guide the tracing of the rest [own; measured]", kSwitch},
    {"direction-weight", 0.05, 0, 10, false, "k_d: weight of directions in the distance of sub-paths [Su et al. 2022, eq. 18]"},
    {"mix", 0.1, 0.001, 1, false,
     "share of Gamma that is not learned: half uniform, half in proportion to Q "
     "[Su et al. 2022, section 7.3: uniform alone]"},
    {"trainer", 0, 0, 2, true,
     "of Gamma: mm (majorise-minimise with a held-out prior; own), adam "
     "[Su et al. 2022, section 7.3], contribution (their figure 6)",
     kTrainers},
    {"windows", 1, 1, 32, true,
     "J_max: light-only windows that rarely hit subspaces may keep "
     "[in place of the reuse of Su et al. 2022, section 7.4]"},
    {"reuse-target", 200, 1, 1e6, false,
     "M0: light prefixes that a subspace should hold, as far as windows allow "
     "[Su et al. 2022, section 7.4]"},
    {"ris-aware", 0, 0, 1, true,
     "weights know that a cache of M paths limits what a subspace can deliver "
     "[Nabata et al. 2020, eq. 9]",
     kSwitch},
    kMerging,
    // Weights know nothing of bias, and connections need little help here: small discs carry what nothing else finds.
    merge_radius_parameter(0.1),
    kMergeRadiusUnit,
    kAlpha,
    kMergeFirst,
    kKernel,
};
static_assert(SubspaceTables::kMaxSubspaces == 16384 && SubspaceTables::kMaxWindow == 32, "the ranges above");
constexpr const TablePart* kParts[] = {&EmissionPart::kPart, &GainPart::kPart, &SubspaceTables::kPart};

LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    const bool grows = s.value("pilot") != 0;
    return {.samples = samples,
            .energy_paths = s.value("energy-paths"),
            .rounds = grows ? growing_rounds(samples) : std::vector<LearningRound>{{samples}},
            .grows = grows,
            .keeps_visits = learns_gain(s),
            .connections = CacheParameters::of(s).connections,
            .correction = correction_of(s),
            .rays = next_event_beside_cache_of(s)};
}

Result<Tables> learn(const LearnRequest& r) {
    const AlgorithmSettings& s = r.settings.algorithm;
    const CacheParameters p = CacheParameters::of(s);
    TrainingOptions options;
    options.light_subspaces = uint32_t(s.value("light-subspaces"));
    options.eye_subspaces = uint32_t(s.value("eye-subspaces"));
    options.source_share = s.value("source-share");
    options.direction_weight = s.value("direction-weight");
    options.mix = s.value("mix");
    options.trainer = GammaTrainer(int(s.value("trainer")));
    options.connections = p.connections;
    options.reuse_windows = int(s.value("windows"));
    options.reuse_target = s.value("reuse-target");
    options.nominal_paths = double(p.minimum_paths);
    options.seed = r.settings.seed;
    const auto guide = r.guide.get<SubspaceTables>();
    options.judged = r.judges_guide ? guide.get() : nullptr;
    WalkLessons walks(r);
    walks.tell(&options);
    auto tables = train_tables(r.data, r.emitters, options, r.control, r.report);
    if (!tables.ok()) return tables.status();
    Tables all(*std::move(tables));
    walks.move_to(&all);
    return all;
}

constexpr LearningInfo kLearning{.parts = kParts, .plan = plan, .learn = learn};

Result<std::unique_ptr<Renderer>> make(const RendererRequest& r) {
    const AlgorithmSettings& settings = r.settings.algorithm;
    const CacheParameters p = CacheParameters::of(settings);
    const auto prepared = std::make_shared<const PreparedTables>(*r.tables.get<SubspaceTables>());
    const SpcbptSelection densities =
        spcbpt_selection(prepared, {.light_paths_per_iteration = double(r.light_paths_per_iteration()),
                                    .connections = p.connections,
                                    .cache_paths = settings.value("ris-aware") != 0 ? double(p.minimum_paths) : 0,
                                    .correction = correction_of(settings),
                                    .roulette = roulette_of(settings),
                                    .rays = next_event_beside_cache_of(settings)});
    if (merging_on(settings)) return make_merging_spcbpt(r, densities, prepared);
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(densities);
        return SpcbptAlgorithm<std::remove_cvref_t<decltype(selection)>>{
            {selection, prepared, p.connections}, heuristic_of(settings), p.minimum_paths};
    });
}

}  // namespace

const AlgorithmInfo kSpcbptRow{
    .name = "spcbpt",
    .summary = "subspace-based probabilistic connections: learns which light sub-paths matter to which camera sub-paths",
    .source = "Su, Li and Wang 2022",
    .bias = "unbiased and misses what bdpt misses; with merging=on as vcm",
    .may_merge = merging_on,
    .parameters = kParameters,
    .light_paths_per_pixel = chosen_light_paths,
    .shares_light_paths = true,
    .learning = &kLearning,
    .make = make,
};

}  // namespace lightloom
