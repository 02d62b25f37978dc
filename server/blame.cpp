#include "server/blame.h"

namespace lightloom {
namespace {

std::string names_of(const WorkerRegistry& workers, const std::set<uint32_t>& indices) {
    std::string names;
    for (const uint32_t index : indices) names += (names.empty() ? "" : ", ") + workers.at(index).id;
    return names;
}

}  // namespace

UnitTable::Failures failures_that_count(const UnitTable::FailedWorkers& by, const WorkerRegistry& workers,
                                        const std::string& job_id, TimePoint now) {
    const bool untried_worker =
        workers.anyone_there([&](const WorkerRecord& w) { return by.contains(w.index) || w.lacks.contains(job_id); }, now);
    const bool enough_workers = int(by.size()) >= kMaxFailedWorkers;
    UnitTable::Failures counted;
    for (const auto& [index, failed] : by) {
        const WorkerRecord& worker = workers.at(index);
        int times = worker.successes > failed.successes ? failed.times : failed.before;
        if (!untried_worker && (!worker.doubted || enough_workers)) times = failed.times;
        if (times == 0) continue;
        counted.total += times;
        ++counted.workers;
    }
    return counted;
}

void unit_failed(OpenBook& book, const JobPtr& file, const UnitKey& key, const UnitTable::Failures& failures, const Status& why,
                 TimePoint now) {
    const std::string unit = unit_name(key);
    book.note().warn(file->job.id() + ": unit " + unit + " failed (" + std::to_string(failures.total) + "): " + why.message());
    WorkerRegistry& workers = book->workers;
    const UnitTable::Failures counted = failures_that_count(failures.by, workers, file->job.id(), now);
    // Units are pure functions: a request that is wrong is wrong on every worker.
    if (counted.workers >= kMaxFailedWorkers || counted.total >= kMaxUnitFailures || why.code() == StatusCode::kInvalidArgument) {
        book.fail(file, {why.code(), "unit " + unit + ": " + why.message()});
        if (why.code() != StatusCode::kInvalidArgument) {
            // Those that never did better may be the cause: before they have, they fail no other job.
            for (const auto& [index, failed] : failures.by) {
                WorkerRecord& worker = workers.at(index);
                if (worker.successes > failed.successes) continue;
                worker.doubted = true;
                worker.failures_in_a_row = 0;
                worker.rests_until = now;
            }
        }
    } else {
        book.changed(file);
    }
    book.units_appeared();
}

void host_failed(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker, const Status& why,
                 TimePoint now) {
    units.release(key, worker.index);
    book->workers.lacks(worker, file->job.id(), why.message(), now);
    book.note().warn(file->job.id() + ": " + worker.id + " gives unit " + unit_name(key) + " back and rests: " + why.message());
    book.changed(file);
    book.units_appeared();
}

void leases_expired(OpenBook& book, const JobPtr& file, UnitTable& units, const std::vector<UnitTable::Expired>& expired,
                    TimePoint now) {
    file->job.incidents.expired_leases += expired.size();
    book.note().warn(file->job.id() + ": " + std::to_string(expired.size()) + " lease(s) ran out; the units go to other workers");
    for (size_t i = 0; i < expired.size(); ++i) book.units_appeared();
    WorkerRegistry& workers = book->workers;
    const auto others = [&](const std::set<uint32_t>& but, TimePoint since) { return workers.others_fell_silent(but, since, now); };
    for (const UnitTable::Expired& lease : expired) {
        // Of the units that a silent worker held, the oldest was being rendered and counts as the cause; the others
        // waited behind it.
        if (!workers.fell_silent(lease.worker, now)) continue;
        const Suspicion::Verdict verdict = units.lose(lease, others);
        const std::string unit = "unit " + unit_name(lease.unit) + ": ";
        if (verdict == Suspicion::Verdict::kSuspect) {
            book.note().warn(file->job.id() + ": " + unit + std::to_string(units.suspicion().lost(lease.unit).size()) +
                             " workers fell silent over it; from now on it runs alone");
        } else if (verdict == Suspicion::Verdict::kGuilty) {
            const std::set<uint32_t> alone = units.suspicion().lost_alone(lease.unit);
            book.fail(file, {StatusCode::kAborted, unit + std::to_string(alone.size()) + " workers fell silent over it (" +
                                                       names_of(workers, alone) +
                                                       "), each while it held nothing else, and no other worker did; it may "
                                                       "crash them or exhaust their memory, see their logs"});
            return;
        }
    }
}

}  // namespace lightloom
