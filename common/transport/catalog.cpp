#include "common/transport/catalog.h"

#include <charconv>
#include <cmath>
#include <sstream>

namespace lightloom {
namespace {

constexpr ParameterInfo kRouletteStart{"rr-start", 4, 2, 256, true,
                                       "sub-path vertices below this index never end by Russian roulette"};
constexpr ParameterInfo kRouletteMin{"rr-min", 0.05, 0.01, 1, false,
                                     "smallest survival probability of Russian roulette; 1 switches roulette off"};
constexpr ParameterInfo kHeuristic{"heuristic", 0, 0, 2, true,
                                   "0 balance [Veach 1997, eq. 9.8], 1 power with exponent 2, 2 maximum"};

constexpr ParameterInfo kWalk[] = {kRouletteStart, kRouletteMin};
constexpr ParameterInfo kWeighted[] = {kRouletteStart, kRouletteMin, kHeuristic};

constexpr AlgorithmInfo kCatalog[] = {
    {"path", "unidirectional path tracing with next event estimation", "Kajiya 1986; Veach 1997, section 9.3",
     "unbiased; misses caustics of lights that cannot be hit", kWeighted, false},
    {"light", "light tracing: light sub-paths connected to the lens", "Dutre, Lafortune and Willems 1993",
     "unbiased; misses what the lens sees through mirrors and smooth glass", kWalk, true},
    {"bdpt", "bidirectional path tracing, every camera sample paired with one light sub-path", "Veach 1997, chapter 10",
     "unbiased; misses specular-diffuse-specular paths from lights that cannot be hit", kWeighted, true},
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
        const bool number = error == std::errc() && end == text.data() + text.size() && std::isfinite(v);
        if (!number || v < p.min_value || v > p.max_value || (p.integer && v != std::floor(v))) {
            std::ostringstream message;
            message << "parameter " << key << "=" << text << " of '" << algorithm.name << "' must be "
                    << (p.integer ? "an integer" : "a number") << " from " << p.min_value << " to " << p.max_value;
            return invalid_argument(message.str());
        }
        parameters.values[i] = v;
    }
    return parameters;
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

double light_paths_per_pixel(const AlgorithmInfo& algorithm, const AlgorithmParameters&) { return algorithm.splats ? 1 : 0; }

}  // namespace lightloom
