#pragma once
// Units that take too long: when a unit is taken away from its worker, and which one a worker that has nothing to do renders a
// second time. Pure functions of what was measured.

#include <optional>
#include <vector>

#include "server/time_bounds.h"
#include "server/unit_table.h"
#include "server/worker_registry.h"

namespace lightloom {

/// Camera samples of a unit, or its light paths if it has none; training samples of a training unit.
double samples_of(const WorkUnit& unit);

/// Seconds for which a worker with this pace (samples a second; 0: not measured) may render the unit.
double longest_seconds(const WorkUnit& unit, double pace, const TimeBounds& bounds);

/// What a job may have rendered twice: a share of its units, but always one at a time.
inline constexpr double kCopyShare = 0.05;
bool may_copy(const UnitTable& units);

/// A copy must promise to be done in this share of the time that the holder still needs. What was measured is not exact, and a
/// copy of a unit that is nearly done is of no use.
inline constexpr double kCopyGain = 0.8;
/// The units of `units` that a worker with `pace` would be done with earlier than their holders; the one that is expected to be
/// done last comes first. None without a pace of its own: it would not know.
std::vector<UnitKey> worth_copying(const UnitTable& units, const std::string& job_id, const WorkerRegistry& workers, double pace,
                                   TimePoint now);

}  // namespace lightloom
