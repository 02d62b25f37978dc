#pragma once
// The emission table as a part of an algorithm's tables.

#include <memory>
#include <string>
#include <string_view>

#include "common/scene/emission_table.h"
#include "common/tables/tables.h"

namespace lightloom {

struct EmissionPart {
    EmissionData data;

    static const TablePart kPart;  ///< "emission"
};

/// The tables' learned emission; null where they have none, or nothing was learned.
std::shared_ptr<const EmissionTable> emission_of(const Tables& tables);

/// The same data have the same bytes on every host.
std::string serialize(const EmissionData& data);
/// kDataLoss when the bytes are no emission table of a known version.
Result<EmissionData> parse_emission(std::string_view bytes);

}  // namespace lightloom
