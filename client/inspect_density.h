#pragma once
// What a learned density map of photons holds, in numbers.

#include <nlohmann/json_fwd.hpp>

#include "common/tables/density_map.h"

namespace lightloom::client {

/// The number of cells with a density of their own, and their photons per light sub-path and square metre: quantiles.
nlohmann::ordered_json describe_density(const DensityData& data);
void print_density(const DensityData& data);

}  // namespace lightloom::client
