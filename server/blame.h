#pragma once
// Who is to blame when a unit is not rendered: the unit, its worker or nobody. A unit that is to blame fails its job. Suspicion
// (suspicion.h) decides about units over which workers fall silent.

#include "server/office.h"

namespace lightloom {

/// A unit that failed on this many workers fails its job, because the unit is the cause and not the workers.
inline constexpr int kMaxFailedWorkers = 3;
/// So does a unit that failed this often, where there are fewer workers.
inline constexpr int kMaxUnitFailures = 10;

/// Failures that count against a unit: those of workers that succeeded with other units afterwards, or all if nobody is there on
/// whom it was not tried. `doubted` workers count only beside others, `kMaxFailedWorkers` together.
UnitTable::Failures failures_that_count(const UnitTable::FailedWorkers& by, const WorkerRegistry& workers,
                                        const std::string& job_id, TimePoint now);

/// A unit could not be rendered, or its result was invalid.
void unit_failed(OpenBook& book, const JobPtr& file, const UnitKey& key, const UnitTable::Failures& failures, const Status& why,
                 TimePoint now);
/// A worker lacks disk or memory, or cannot use its disk, and gives the unit back: that is no fault of the unit.
void host_failed(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker, const Status& why,
                 TimePoint now);
/// Leases of the job ran out at `now`.
void leases_expired(OpenBook& book, const JobPtr& file, UnitTable& units, const std::vector<UnitTable::Expired>& expired,
                    TimePoint now);

}  // namespace lightloom
