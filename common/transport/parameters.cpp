#include "common/transport/parameters.h"

#include <algorithm>
#include <cmath>

#include "common/path/path_view.h"

namespace lightloom {
namespace {

/// Whole units, so that both rounds are planned alike; none when the set is too small for two rounds.
uint64_t pilot_of(uint64_t samples, double share) {
    const uint64_t units = samples / kTrainingUnitSamples;
    if (share <= 0 || units < 2) return 0;
    return kTrainingUnitSamples * std::clamp(uint64_t(std::llround(share * double(units))), uint64_t(1), units - 1);
}

}  // namespace

Result<TransportParameters> TransportParameters::read(const RenderSettings& settings) {
    const Result<const AlgorithmInfo*> info = find_algorithm(settings.algorithm);
    if (!info.ok()) return info.status();
    const Result<AlgorithmParameters> parameters = parse_parameters(**info, settings.parameters);
    if (!parameters.ok()) return parameters.status();
    if (settings.max_depth < 0 || settings.max_depth + 1 > kMaxEdges)
        return invalid_argument("max depth must lie between 0 and " + std::to_string(kMaxEdges - 1) + ", not " +
                                std::to_string(settings.max_depth));
    const auto value = [&](std::string_view name) { return parameter_value(**info, *parameters, name); };
    TransportParameters p;
    p.roulette.first_vertex = int(value("rr-start"));
    p.roulette.min_survival = float(value("rr-min"));
    p.roulette.max_survival = std::max(p.roulette.max_survival, p.roulette.min_survival);  // rr-min=1 switches roulette off
    if (has_parameter(**info, "heuristic")) p.heuristic = Heuristic(int(value("heuristic")));
    p.light_paths = light_paths_per_pixel(**info, *parameters);
    p.needs_tables = (*info)->needs_tables;
    if (!p.needs_tables) return p;

    p.connections = int(value("connections"));
    p.minimum_paths = uint64_t(value("cache"));
    p.training_samples = uint64_t(value("training-paths"));
    TrainingOptions& t = p.training;
    t.connections = p.connections;
    t.nominal_paths = double(p.minimum_paths);
    t.seed = settings.seed;
    if (!has_parameter(**info, "light-subspaces")) {
        t.light_subspaces = t.eye_subspaces = 1;  // uniform selection: only the vertices are counted
        return p;
    }
    p.ris_aware = value("ris-aware") != 0;
    p.correlation_aware = value("correlation-aware") != 0;
    t.light_subspaces = uint32_t(value("light-subspaces"));
    t.eye_subspaces = uint32_t(value("eye-subspaces"));
    t.source_share = value("source-share");
    t.direction_weight = value("direction-weight");
    t.mix = value("mix");
    t.trainer = GammaTrainer(int(value("trainer")));
    p.energy_paths = value("energy-paths");
    p.pilot_samples = pilot_of(p.training_samples, value("pilot"));
    t.reuse_windows = int(value("windows"));
    t.reuse_target = value("reuse-target");
    return p;
}

}  // namespace lightloom
