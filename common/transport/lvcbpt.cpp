#include "common/transport/lvcbpt.h"

#include "common/tables/subspace_tables.h"
#include "common/transport/learn_walks.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

extern const AlgorithmInfo kLvcbptRow;

namespace {

constexpr ParameterInfo kParameters[] = {
    kRouletteByAlbedo,
    kRouletteStart,
    kRouletteMin,
    kHeuristicOfSharing,
    kTechniques,
    kNextEventBesideCache,
    kShadowRaysBesideCache,
    kLightPaths,
    kCache,
    kConnections,
    emission_parameter(false),
    {kTrainingPaths, 20000, 1, 1e8, true,
     "light sub-paths that count the vertices per path before rendering, and from which emission=learned and roulette=learned "
     "learn; at most, where a job settles it"},
};
constexpr const TablePart* kParts[] = {&EmissionPart::kPart, &GainPart::kPart, &SubspaceTables::kPart};

LearningPlan plan(const AlgorithmSettings& s) {
    const uint64_t samples = uint64_t(s.value(kTrainingPaths));
    return {.samples = samples,
            .rounds = learns_emission(s) ? growing_rounds(samples) : std::vector<LearningRound>{{samples}},
            .keeps_visits = learns_gain(s),
            .connections = CacheParameters::of(s).connections};
}

/// Learns with one subspace on each side: selection is uniform, and only the number of vertices per path matters.
Result<Tables> learn(const LearnRequest& r) {
    const CacheParameters p = CacheParameters::of(r.settings.algorithm);
    TrainingOptions options;
    options.light_subspaces = options.eye_subspaces = 1;
    options.connections = p.connections;
    options.nominal_paths = double(p.minimum_paths);
    options.seed = r.settings.seed;
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
    const double vertices_per_path = r.tables.get<SubspaceTables>()->vertices_per_path;
    const UniformSelection uniform{.light_paths_per_iteration = double(r.light_paths_per_iteration()),
                                   .connection_density = p.connections.each([&](int n) { return double(n) / vertices_per_path; }),
                                   .survival = TypicalSurvival(roulette_of(settings)),
                                   .rays = next_event_beside_cache_of(settings),
                                   .connections = p.connections.each([](int n) { return double(n); })};
    return make_corrected(uniform, correction_of(settings), [&](const auto& densities) {
        return make_unit_renderer(r, [&](auto&& select) {
            const auto selection = select(densities);
            return LvcbptAlgorithm<std::remove_cvref_t<decltype(selection)>>{
                {selection, p.connections}, heuristic_of(settings), p.minimum_paths};
        });
    });
}

}  // namespace

const AlgorithmInfo kLvcbptRow{
    .name = "lvcbpt",
    .summary = "bidirectional path tracing with a light-vertex cache, vertices drawn uniformly",
    .source = "Davidovic, Krivanek, Hasan and Slusallek 2014, section 4.1",
    .bias = "unbiased; misses what bdpt misses",
    .parameters = kParameters,
    .light_paths_per_pixel = chosen_light_paths,
    .shares_light_paths = true,
    .learning = &kLearning,
    .make = make,
};

}  // namespace lightloom
