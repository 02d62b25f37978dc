#pragma once
// The density map as a part of an algorithm's tables.

#include <memory>
#include <string>
#include <string_view>

#include "common/tables/density_map.h"
#include "common/tables/tables.h"

namespace lightloom {

struct DensityPart {
    DensityData data;

    static const TablePart kPart;  ///< "density"
};

/// The tables' density map; null where they have none, or nothing was learned.
std::shared_ptr<const DensityMap> density_of(const Tables& tables);

/// The same data have the same bytes on every host.
std::string serialize(const DensityData& data);
/// kDataLoss when the bytes are no density map of a known version.
Result<DensityData> parse_density(std::string_view bytes);

}  // namespace lightloom
