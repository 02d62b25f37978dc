#include "server/blame.h"

namespace lightloom {

void unit_failed(OpenBook& book, const JobPtr& file, const UnitKey& key, UnitTable::Failures failures, const Status& why) {
    const std::string unit = unit_name(key);
    book.note().warn(file->job.id() + ": unit " + unit + " failed (" + std::to_string(failures.total) + "): " + why.message());
    // Units are pure functions: a request that is wrong is wrong on every worker.
    if (failures.workers >= kMaxFailedWorkers || failures.total >= kMaxUnitFailures || why.code() == StatusCode::kInvalidArgument)
        book.fail(file, {why.code(), "unit " + unit + ": " + why.message()});
    book.units_appeared();
}

void leases_expired(OpenBook& book, const JobPtr& file, UnitTable& units, const std::vector<UnitTable::Expired>& expired,
                    TimePoint now) {
    file->job.incidents.expired_leases += expired.size();
    book.note().warn(file->job.id() + ": " + std::to_string(expired.size()) + " lease(s) ran out; the units go to other workers");
    for (size_t i = 0; i < expired.size(); ++i) book.units_appeared();
    WorkerRegistry& workers = book->workers;
    for (const UnitTable::Expired& lease : expired) {
        // Of the units that a silent worker held, the oldest was being rendered and counts as the cause; the others
        // waited behind it.
        if (!workers.fell_silent(lease.worker, now)) continue;
        const std::set<uint32_t> lost = units.lose(lease.unit, lease.worker);
        if (lost.size() < kMaxLostWorkers) continue;
        std::string names;
        for (const uint32_t index : lost) names += (names.empty() ? "" : ", ") + workers.at(index).id;
        book.fail(file, {StatusCode::kAborted, "unit " + unit_name(lease.unit) + ": " + std::to_string(lost.size()) +
                                                   " workers fell silent over it (" + names +
                                                   "); it may crash them or exhaust their memory, see their logs"});
        return;
    }
}

}  // namespace lightloom
