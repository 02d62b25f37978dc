#include "common/transport/catalog.h"

#include <charconv>
#include <cmath>
#include <sstream>

namespace lightloom {
namespace {

constexpr ParameterInfo kRouletteStart{"rr-start",
                                       4,
                                       2,
                                       256,
                                       true,
                                       "sub-path vertices below this index never end by Russian roulette "
                                       "[Pharr, Jakob and Humphreys 2023, 2.2.4]"};
// The weights know a typical survival at best, so that a technique whose sub-path rarely survives is trusted too much: at 0.05,
// door needs 1.4 (spcbpt), 1.7 (bdpt) and 2.5 (path) times the processor time for the same relMSE; at 1 the walks cost more than
// they save.
constexpr ParameterInfo kRouletteMin{"rr-min",
                                     0.5,
                                     0.01,
                                     1,
                                     false,
                                     "smallest survival probability of Russian roulette; 1 switches roulette off "
                                     "[measured: best of 0.05 to 1]"};
constexpr std::string_view kHeuristics[] = {"balance", "power", "maximum"};
constexpr std::string_view kTrainers[] = {"mm", "adam", "contribution"};
constexpr std::string_view kSwitch[] = {"off", "on"};

constexpr ParameterInfo kHeuristic{"heuristic", 0, 0, 2, true, "balance [Veach 1997, eq. 9.8], power with exponent 2, or maximum",
                                   kHeuristics};
constexpr ParameterInfo kLightPaths{"light-paths",
                                    0.3,
                                    0.001,
                                    64,
                                    false,
                                    "N1 and M: light sub-paths per pixel and iteration; all of them splat and fill the cache "
                                    "[Su et al. 2022, section 8.1: 1e5 per iteration, 0.05 per pixel]"};
constexpr ParameterInfo kCache{"cache",
                               20000,
                               1,
                               1e8,
                               true,
                               "smallest number of light sub-paths in a unit's cache, however few camera samples it has "
                               "[Davidovic et al. 2014 fill one per image]"};
constexpr ParameterInfo kConnections{"connections", 3, 1, 64, true, "N: connections per camera vertex [Su et al. 2022, table 3]"};

constexpr ParameterInfo kWalk[] = {kRouletteStart, kRouletteMin};
constexpr ParameterInfo kWeighted[] = {kRouletteStart, kRouletteMin, kHeuristic};
constexpr ParameterInfo kUniformCache[] = {
    kRouletteStart,
    kRouletteMin,
    kHeuristic,
    kLightPaths,
    kCache,
    kConnections,
    {"training-paths", 20000, 1, 1e8, true, "light sub-paths that count the vertices per path before rendering"},
};
constexpr ParameterInfo kSubspaces[] = {
    kRouletteStart,
    kRouletteMin,
    kHeuristic,
    kLightPaths,
    kCache,
    kConnections,
    {"light-subspaces", 1000, 1, 16384, true, "N_L: upper bound of the light subspaces [Su et al. 2022, section 8.1]"},
    {"eye-subspaces", 1000, 1, 16384, true, "N_E: upper bound of the eye subspaces [Su et al. 2022, section 8.1]"},
    {"source-share", 0.2, 0, 1, false, "share of N_L that divides the lights themselves [Su et al. 2022, section 7.2.1]"},
    {"training-paths", 500000, 1, 1e8, true,
     "D: camera samples of the training set, each with a light sub-path [Su et al. 2022: 1e6]"},
    {"energy-paths", 1, 0.01, 16, false,
     "M' over D: light sub-paths that measure Q, per camera sample of the training set [Su et al. 2022: 2]"},
    {"pilot", 0.2, 0, 1, false,
     "share of the training set that is traced first, to guide the tracing of the rest; 0: no second round [own; measured]"},
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
    {"correlation-aware", 1, 0, 1, true,
     "weights know that the N connections of a vertex share its camera sub-path [Grittmann et al. 2021]", kSwitch},
    {"ris-aware", 0, 0, 1, true,
     "weights know that a cache of M paths limits what a subspace can deliver "
     "[Nabata et al. 2020, eq. 9]",
     kSwitch},
};

constexpr AlgorithmInfo kCatalog[] = {
    {"path", "unidirectional path tracing with next event estimation", "Kajiya 1986; Veach 1997, section 9.3",
     "unbiased; misses caustics of lights that cannot be hit", kWeighted, false},
    {"light", "light tracing: light sub-paths connected to the lens", "Dutre, Lafortune and Willems 1993",
     "unbiased; misses what the lens sees through mirrors and smooth glass", kWalk, true},
    {"bdpt", "bidirectional path tracing, every camera sample paired with one light sub-path", "Veach 1997, chapter 10",
     "unbiased; misses specular-diffuse-specular paths from lights that cannot be hit", kWeighted, true},
    {"lvcbpt", "bidirectional path tracing with a light-vertex cache, vertices drawn uniformly",
     "Davidovic, Krivanek, Hasan and Slusallek 2014, section 4.1", "unbiased; misses what bdpt misses", kUniformCache, true, true},
    {"spcbpt", "subspace-based probabilistic connections: learns which light sub-paths matter to which camera sub-paths",
     "Su, Li and Wang 2022", "unbiased; misses what bdpt misses", kSubspaces, true, true},
};

}  // namespace

std::span<const AlgorithmInfo> catalog() { return kCatalog; }

Result<const AlgorithmInfo*> find_algorithm(std::string_view name) {
    std::string known;
    for (const AlgorithmInfo& a : kCatalog) {
        if (a.name == name) return &a;
        known += (known.empty() ? "" : ", ") + std::string(a.name);
    }
    return not_found("no algorithm named '" + std::string(name) + "'; choose one of: " + known);
}

Result<AlgorithmParameters> parse_parameters(const AlgorithmInfo& algorithm, const std::map<std::string, std::string>& set) {
    AlgorithmParameters parameters;
    for (const ParameterInfo& p : algorithm.parameters) parameters.values.push_back(p.default_value);
    for (const auto& [key, text] : set) {
        size_t i = 0;
        while (i < algorithm.parameters.size() && algorithm.parameters[i].name != key) ++i;
        if (i == algorithm.parameters.size())
            return invalid_argument("algorithm '" + std::string(algorithm.name) + "' has no parameter '" + key +
                                    "'; `lightloom algorithms` lists them");
        const ParameterInfo& p = algorithm.parameters[i];
        double v = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
        bool number = error == std::errc() && end == text.data() + text.size() && std::isfinite(v);
        std::string names;
        for (size_t c = 0; c < p.choices.size(); ++c) {
            names += (c ? ", " : " (") + std::string(p.choices[c]);
            if (p.choices[c] == text) v = double(c), number = true;
        }
        if (!number || v < p.min_value || v > p.max_value || (p.integer && v != std::floor(v))) {
            std::ostringstream message;
            message << "parameter " << key << "=" << text << " of '" << algorithm.name << "' must be "
                    << (p.integer ? "an integer" : "a number") << " from " << p.min_value << " to " << p.max_value << names
                    << (names.empty() ? "" : ")");
            return invalid_argument(message.str());
        }
        parameters.values[i] = v;
    }
    return parameters;
}

bool has_parameter(const AlgorithmInfo& algorithm, std::string_view name) {
    for (const ParameterInfo& p : algorithm.parameters)
        if (p.name == name) return true;
    return false;
}

double parameter_value(const AlgorithmInfo& algorithm, const AlgorithmParameters& parameters, std::string_view name) {
    for (size_t i = 0; i < algorithm.parameters.size(); ++i)
        if (algorithm.parameters[i].name == name) return parameters.values[i];
    return 0;
}

std::map<std::string, std::string> complete_parameters(const AlgorithmInfo& algorithm, const AlgorithmParameters& values) {
    std::map<std::string, std::string> out;
    for (size_t i = 0; i < algorithm.parameters.size(); ++i) {
        char text[64];
        const auto end = std::to_chars(text, text + sizeof text, values.values[i]).ptr;
        out[std::string(algorithm.parameters[i].name)] = std::string(text, end);
    }
    return out;
}

double light_paths_per_pixel(const AlgorithmInfo& algorithm, const AlgorithmParameters& parameters) {
    if (!algorithm.splats) return 0;
    return has_parameter(algorithm, "light-paths") ? parameter_value(algorithm, parameters, "light-paths") : 1;
}

}  // namespace lightloom
