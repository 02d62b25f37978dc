#include "server/choose_unit.h"

#include "server/straggler.h"

namespace lightloom {
namespace {

using Turn = Choice::Turn;
using Kind = Choice::Kind;

Choice leased(const Offer& offer, const WorkUnit& unit, Kind kind) { return {Turn::kLeased, kind, offer.job, unit}; }

/// Looks at one job. Nothing if the worker has to look at the next one.
std::optional<Choice> choose_from(const Offer& offer, const WorkerRecord& worker, const WorkerRegistry& workers, size_t idle,
                                  TimePoint now, TimePoint expiry) {
    UnitTable& units = *offer.units;
    const std::string id(offer.id);
    // For the unit's job, a worker whose host lacks something is not there.
    const auto anyone_else = [&](const UnitTable::FailedWorkers& but) {
        return workers.anyone_else([&](const WorkerRecord& w) { return but.contains(w.index) || w.lacks.contains(id); }, now);
    };
    if (units.has_suspect()) {
        // As long as a suspect waits, nobody gets a second unit: somebody will soon hold nothing, and take it.
        if (!worker.held.empty()) return Choice{.turn = Turn::kNotForThisOne, .unit = {}};
        if (const auto unit = units.lease_suspect(worker.index, now, expiry, anyone_else))
            return leased(offer, *unit, Kind::kSuspect);
    }
    if (units.holds_back_others()) return std::nullopt;
    if (!worker.held.empty() && !units.has_more_than(idle)) return std::nullopt;
    if (const auto unit = units.lease(worker.index, now, expiry, anyone_else)) return leased(offer, *unit, Kind::kUnit);
    return std::nullopt;
}

std::optional<Choice> choose_copy(const Offer& offer, const WorkerRecord& worker, const WorkerRegistry& workers, TimePoint now,
                                  TimePoint expiry) {
    const std::string id(offer.id);
    const double pace = worker.samples_per_second(id);
    if (pace <= 0 || !offer.renders || WorkerRegistry::rests_from(worker, id, now) || !may_copy(*offer.units)) return std::nullopt;
    for (const UnitKey& key : worth_copying(*offer.units, id, workers, pace, now))
        if (const auto unit = offer.units->copy(key, worker.index, now, expiry)) return leased(offer, *unit, Kind::kCopy);
    return std::nullopt;
}

}  // namespace

Choice choose_unit(const Offers& offers, const WorkerRecord& worker, const WorkerRegistry& workers, TimePoint now,
                   TimePoint expiry) {
    if (!worker.has_room() || workers.rests(worker, now)) return {.turn = Turn::kNotForThisOne, .unit = {}};
    // A worker gets a second unit only if enough are left for the workers that have none: a unit must not wait behind
    // another one while a worker idles.
    const size_t idle = worker.held.empty() ? 0 : workers.idle();
    bool passed_over = false;
    std::optional<Choice> choice;
    offers([&](const Offer& offer) {
        UnitTable& units = *offer.units;
        if (!units.has_suspect() && (units.holds_back_others() || !units.has_more_than(0))) return true;
        passed_over = true;
        if (WorkerRegistry::rests_from(worker, std::string(offer.id), now)) return true;
        choice = choose_from(offer, worker, workers, idle, now, expiry);
        return !choice;
    });
    if (!choice && worker.held.empty()) {
        offers([&](const Offer& offer) {
            choice = choose_copy(offer, worker, workers, now, expiry);
            return !choice;
        });
    }
    if (choice) return *choice;
    return {.turn = passed_over ? Turn::kNotForThisOne : Turn::kNothingLeft, .unit = {}};
}

}  // namespace lightloom
