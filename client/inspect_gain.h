#pragma once
// What a learned gain table of Russian roulette holds, in numbers.

#include <nlohmann/json_fwd.hpp>

#include "common/tables/gain_table.h"

namespace lightloom::client {

/// Numbers of places and of blocks of the frame, and how many sub-paths should go on from a place with the throughput of the
/// pixel's brightness: as roulette reads it (keep) and as splitting does.
nlohmann::ordered_json describe_gain(const GainData& data);
void print_gain(const GainData& data);

}  // namespace lightloom::client
