#pragma once
// Who is to blame when a unit is not rendered: the unit, its worker or nobody. A unit that is to blame fails its job.

#include "server/office.h"

namespace lightloom {

/// A unit that failed on this many workers fails its job, because the unit is the cause and not the workers.
inline constexpr int kMaxFailedWorkers = 3;
/// So does a unit that failed this often, where there are fewer workers.
inline constexpr int kMaxUnitFailures = 10;
/// A unit over which this many workers went silent fails its job: it seems to crash them. The number is larger than for
/// failures, because hosts also go down for other reasons.
inline constexpr size_t kMaxLostWorkers = 5;

/// A unit could not be rendered, or its result was invalid, `failures` times by now.
void unit_failed(OpenBook& book, const JobPtr& file, const UnitKey& key, UnitTable::Failures failures, const Status& why);
/// Leases of the job ran out at `now`.
void leases_expired(OpenBook& book, const JobPtr& file, UnitTable& units, const std::vector<UnitTable::Expired>& expired,
                    TimePoint now);

}  // namespace lightloom
