#pragma once
// Which unit a worker gets next: the policy of the desk for workers (dispatch.h), without lock, clock or disk.
//
// - Jobs are served in their order; a later one gives what an earlier one has no unit for.
// - A worker holds the unit in work and one more, and a second one only if enough are left for the workers that have none.
// - A suspect goes to a worker that holds nothing; while one waits, nobody gets a second unit.
// - Who finds nothing gets a copy of a straggler, where that saves time.

#include <functional>
#include <optional>
#include <string_view>

#include "server/unit_table.h"
#include "server/worker_registry.h"

namespace lightloom {

/// A job that may have units for the worker.
struct Offer {
    uint64_t job = 0;  ///< Number of the caller's choice.
    std::string_view id;
    UnitTable* units = nullptr;
    bool renders = false;  ///< Whether the units are those of its image, of which stragglers are copied.
};
/// Calls the visitor with the jobs in the order in which they are served, until it returns false.
using Offers = std::function<void(const std::function<bool(const Offer&)>& visit)>;

struct Choice {
    enum class Turn { kLeased, kNotForThisOne, kNothingLeft };
    enum class Kind { kUnit, kSuspect, kCopy };

    Turn turn = Turn::kNothingLeft;
    // With kLeased:
    Kind kind = Kind::kUnit;
    uint64_t job = 0;
    WorkUnit unit;
};

/// Chooses a unit, which is leased to the worker until `expiry` then. kNotForThisOne: others may get what this worker may not.
Choice choose_unit(const Offers& offers, const WorkerRecord& worker, const WorkerRegistry& workers, TimePoint now,
                   TimePoint expiry);

}  // namespace lightloom
