#pragma once
// The gain table as a part of an algorithm's tables.

#include <memory>
#include <string>
#include <string_view>

#include "common/tables/gain_table.h"
#include "common/tables/tables.h"

namespace lightloom {

struct GainPart {
    GainData data;

    static const TablePart kPart;  ///< "gain"
};

/// The tables' gains for a frame with this crop; null where they have none, or nothing was learned. kFailedPrecondition
/// if they were learned for another frame.
Result<std::shared_ptr<const GainTable>> gain_of(const Tables& tables, const Rect& crop);

/// The same data have the same bytes on every host.
std::string serialize(const GainData& data);
/// kDataLoss when the bytes are no gain table of a known version.
Result<GainData> parse_gain(std::string_view bytes);

}  // namespace lightloom
