#pragma once
// What a learned emission table holds, in numbers: how much of it was learned, and which lights it prefers.

#include <nlohmann/json_fwd.hpp>

#include "common/scene/scene.h"

namespace lightloom::client {

/// Numbers of emitters, places and directions that were learned, shares that stay by power, and the lights from which most
/// light sub-paths leave.
nlohmann::ordered_json describe_emission(const EmissionData& data, const Scene& scene);
void print_emission(const EmissionData& data, const Scene& scene);

}  // namespace lightloom::client
