#include "server/intake.h"

#include "common/core/crash_point.h"
#include "server/blame.h"
#include "server/finish_job.h"

namespace lightloom {
namespace {

Status not_running(const std::string& job_id) { return not_found("job " + job_id + " is not running (any more)"); }

}  // namespace

SubmitAck unexpected_result(const Status& why) {
    return {why.code() == StatusCode::kNotFound ? SubmitOutcome::kStale : SubmitOutcome::kRejected, why.message()};
}

Result<PartialExpectation> Intake::expected_partial(const UnitReference& reference) const {
    const OpenBook book(office_);
    const JobPtr file = book->find(reference.job_id);
    if (!file || file->job.state() != JobState::kRunning) return not_running(reference.job_id);
    const UnitTable* const units = file->job.open_units(reference.key);
    const auto unit = units ? units->find(reference.key) : std::nullopt;
    if (!unit) return invalid_argument("job " + reference.job_id + " has leased no such unit");
    return PartialExpectation{file->job.spec().frame, unit->render.tile, unit->render.samples_per_pixel(),
                              unit->render.light_path_count};
}

Result<SubmitAck> Intake::submit_payload(const std::string& worker_id, const UnitReference& unit,
                                         const PartialDescriptor& descriptor, std::string_view payload, double render_seconds) {
    crash_point("server.result-received");
    const auto expected = expected_partial(unit);
    if (!expected.ok()) return unexpected_result(expected.status());
    auto partial = decode_partial(*expected, descriptor, payload);
    if (partial.ok()) return submit_partial(worker_id, unit, descriptor.payload_digest, *std::move(partial), render_seconds);

    OpenBook book(office_);
    WorkerRecord* const worker = book->workers.find(worker_id);
    if (!worker) return no_worker(worker_id);
    worker->held.erase(unit);
    const JobPtr file = book->find(unit.job_id);
    UnitTable* const units = file ? file->job.open_units(unit.key) : nullptr;
    if (units) return reject_result(book, file, *units, unit.key, *worker, partial.status());
    return SubmitAck{SubmitOutcome::kRejected, partial.status().message()};
}

SubmitAck Intake::reject_result(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker,
                                const Status& why) {
    ++file->job.incidents.rejected;
    book->workers.unit_failed(worker, office_.now());
    unit_failed(book, file, key, units.fail(key, worker.index), why);
    return {SubmitOutcome::kRejected, why.message()};
}

std::optional<SubmitAck> Intake::repeated_result(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key,
                                                 const WorkerRecord& worker, const Digest& digest) {
    switch (units.complete(key, worker.index, digest)) {
        case UnitTable::Completion::kUnknown: return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
        case UnitTable::Completion::kDuplicateSame:
            ++file->job.incidents.duplicates_same;
            book.changed(file);
            return SubmitAck{SubmitOutcome::kDuplicateSame, {}};
        case UnitTable::Completion::kDuplicateDifferent:
            ++file->job.incidents.duplicates_different;
            book.changed(file);
            book.note().error(file->job.id() + ": unit " + unit_name(key) + " from " + worker.id +
                              " differs from the bytes accepted before; one of two workers computes wrongly: compare their hosts "
                              "and builds");
            return SubmitAck{SubmitOutcome::kDuplicateDifferent, "the unit was accepted before with other bytes"};
        case UnitTable::Completion::kFirst: break;
    }
    return std::nullopt;
}

Result<SubmitAck> Intake::submit_partial(const std::string& worker_id, const UnitReference& reference, const Digest& digest,
                                         Partial partial, double render_seconds) {
    JobPtr file;
    std::shared_ptr<Reducer> reducer;
    uint32_t index = 0;
    WorkUnit unit;
    {
        OpenBook book(office_);
        WorkerRecord* const worker = book->workers.find(worker_id);
        if (!worker) return no_worker(worker_id);
        worker->last_heard = office_.now();
        worker->held.erase(reference);
        file = book->find(reference.job_id);
        if (!file || file->job.state() != JobState::kRunning) return unexpected_result(not_running(reference.job_id));
        index = worker->index;
        UnitTable* const units = file->job.open_units(reference.key);
        const auto known = units ? units->find(reference.key) : std::nullopt;
        if (!known) return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
        if (auto answer = repeated_result(book, file, *units, reference.key, *worker, digest)) return *std::move(answer);
        unit = *known;
        reducer = file->job.reducer();
    }
    const Job::Work work{index, partial.counters, partial.dropped_count};
    crash_point("server.before-merge");
    const auto refused = reducer->add(unit, partial);
    crash_point("server.after-merge");
    partial = {};

    OpenBook book(office_);
    Job& job = file->job;
    if (job.state() != JobState::kRunning) return SubmitAck{SubmitOutcome::kStale, "the job ended meanwhile"};
    if (!refused.ok()) {
        book.fail(file, refused.status());
        return SubmitAck{SubmitOutcome::kRejected, refused.status().message()};
    }
    if (const std::optional<Status>& why = *refused) {
        ++job.incidents.rejected;
        unit_failed(book, file, unit.key, job.open_units()->reopen(unit.key), *why);
        return SubmitAck{SubmitOutcome::kRejected, why->message()};
    }
    WorkerRecord& worker = book->workers.at(index);
    const UnitCounters& counters = work.counters;
    worker.delivered(job.id(), double(counters.camera_samples > 0 ? counters.camera_samples : counters.light_paths),
                     render_seconds);
    ++worker.merged;
    book->workers.unit_succeeded(worker);
    book.apply(file, job.count(work));
    finish_if_complete(office_, book, file);
    crash_point("server.result-counted");
    return SubmitAck{SubmitOutcome::kAccepted, {}};
}

Result<uint64_t> Intake::expected_training_bytes(const UnitReference& reference) const {
    const OpenBook book(office_);
    const JobPtr file = book->find(reference.job_id);
    const UnitTable* const units = file ? file->job.open_units(reference.key) : nullptr;
    if (!units || reference.key.kind == UnitKind::kRender)
        return not_found("job " + reference.job_id + " takes no such training data (any more)");
    const auto unit = units->find(reference.key);
    if (!unit) return invalid_argument("job " + reference.job_id + " has leased no such unit");
    return largest_training_payload(file->job.spec(), unit->training);
}

Result<SubmitAck> Intake::submit_training(const std::string& worker_id, const UnitReference& reference, const Digest& digest,
                                          std::string_view payload, double trace_seconds) {
    crash_point("server.training-received");
    const auto limit = expected_training_bytes(reference);
    if (!limit.ok()) return unexpected_result(limit.status());
    Result<TrainingData> data = data_loss("the training data differ from their digest");
    if (payload.size() > *limit) {
        data = invalid_argument("more training data than the unit can have");
    } else if (sha256(payload) == digest) {
        data = parse_training_data(payload);
    }
    if (!(trace_seconds >= 0 && trace_seconds < 1e9)) trace_seconds = 0;

    OpenBook book(office_);
    WorkerRecord* const worker = book->workers.find(worker_id);
    if (!worker) return no_worker(worker_id);
    const TimePoint now = office_.now();
    worker->last_heard = now;
    worker->held.erase(reference);
    const JobPtr file = book->find(reference.job_id);
    UnitTable* const units = file ? file->job.open_units(reference.key) : nullptr;
    if (!units) return SubmitAck{SubmitOutcome::kStale, "job " + reference.job_id + " has its training data already"};
    const auto unit = units->find(reference.key);
    if (!unit) return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
    Status problem = data.status();
    if (problem.ok()) problem = check_unit_data(*data, file->job.spec(), unit->training);
    if (!problem.ok()) return reject_result(book, file, *units, reference.key, *worker, problem);
    if (auto answer = repeated_result(book, file, *units, reference.key, *worker, digest)) return *std::move(answer);
    book->workers.unit_succeeded(*worker);
    Preparation& preparation = file->job.preparation();
    preparation.start_clock(seconds_after(now, -trace_seconds));  // a short unit may be over before a heartbeat tells of it
    TrainingRound& round = *preparation.round;
    round.add(reference.key.group, {*std::move(data), payload.size(), trace_seconds});
    // A set that is far too large is noticed before hours are spent on it.
    const uint64_t most = office_.options.training_bytes;
    if (round.bytes() > most || round.projected_bytes() > 1.25 * double(most)) {
        book.fail(file,
                  {StatusCode::kResourceExhausted, "the training data need more than the " + std::to_string(most >> 20) +
                                                       " MiB that a job may have; choose fewer training-paths or energy-paths"});
        return SubmitAck{SubmitOutcome::kRejected, file->job.message()};
    }
    file->job.stop_idle_clock(now);
    book.changed(file);
    crash_point("server.training-counted");
    return SubmitAck{SubmitOutcome::kAccepted, {}};
}

}  // namespace lightloom
