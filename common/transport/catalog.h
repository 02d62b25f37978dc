#pragma once
// The catalog: every algorithm with its parameters, defaults, ranges and sources. One row per algorithm; the command line,
// the documentation (`lightloom algorithms`), validation and the parameterised test suites all read it from here.

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"

namespace lightloom {

struct ParameterInfo {
    std::string_view name;
    double default_value;
    double min_value, max_value;
    bool integer;
    std::string_view help;  ///< What it does, unit, source.
    /// Names of the values 0, 1, ... where a name says more than a number; both are understood.
    std::span<const std::string_view> choices = {};
};

struct AlgorithmInfo {
    std::string_view name;
    std::string_view summary;  ///< One line.
    std::string_view source;   ///< Paper or book, with equation numbers.
    std::string_view bias;     ///< "unbiased", or what is biased or missing.
    std::span<const ParameterInfo> parameters;
    bool splats;                ///< Traces light paths that land anywhere on the frame.
    bool needs_tables = false;  ///< Reads tables that training units make first (common/tables).
};

/// Parsed, validated parameters of one algorithm, in the order of its AlgorithmInfo::parameters.
struct AlgorithmParameters {
    std::vector<double> values;
};

std::span<const AlgorithmInfo> catalog();
/// kNotFound, listing the known names, for an unknown algorithm.
Result<const AlgorithmInfo*> find_algorithm(std::string_view name);
/// Unknown key, not a number, or out of range: kInvalidArgument naming the key, the range and the algorithm.
Result<AlgorithmParameters> parse_parameters(const AlgorithmInfo& algorithm, const std::map<std::string, std::string>& set);
bool has_parameter(const AlgorithmInfo& algorithm, std::string_view name);
/// Value of a parameter that the algorithm has.
double parameter_value(const AlgorithmInfo& algorithm, const AlgorithmParameters& parameters, std::string_view name);
/// All parameters with their values as canonical text, so that an image says what was rendered even where defaults applied.
std::map<std::string, std::string> complete_parameters(const AlgorithmInfo& algorithm, const AlgorithmParameters& values);
/// N1: light paths splatted per pixel and iteration, one constant of the frame.
double light_paths_per_pixel(const AlgorithmInfo& algorithm, const AlgorithmParameters& parameters);

}  // namespace lightloom
