#include "server/intake.h"

#include <new>

#include "common/core/crash_point.h"
#include "server/blame.h"
#include "server/finish_job.h"

namespace lightloom {
namespace {

/// Between two checkpoints come at least four times as many bytes of results as one takes.
constexpr uint64_t kStateBytesPerPixel = 120;
/// The time that a job with a limit has taken is written down that often.
constexpr double kSpentSeconds = 5, kSpentShare = 0.01;

Status not_running(const std::string& job_id) { return not_found("job " + job_id + " is not running (any more)"); }

}  // namespace

SubmitAck unexpected_result(const Status& why) {
    return {why.code() == StatusCode::kNotFound ? SubmitOutcome::kStale : SubmitOutcome::kRejected, why.message()};
}

Result<PartialExpectation> Intake::expected_partial(const UnitReference& reference) const {
    const OpenBook book(office_);
    const JobPtr file = book->find(reference.job_id);
    if (!file || file->job.state() != JobState::kRunning) return not_running(reference.job_id);
    UnitTable* const units = file->job.open_units(reference.key);
    if (units) units->open_for(reference.key);
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
    if (partial.ok()) return take_partial(worker_id, unit, {descriptor, payload}, *std::move(partial), render_seconds);

    OpenBook book(office_);
    const auto [worker, file, units] = book->take_back(worker_id, unit);
    if (!worker) return no_worker(worker_id);
    if (units) return reject_result(book, file, *units, unit.key, *worker, partial.status());
    return SubmitAck{SubmitOutcome::kRejected, partial.status().message()};
}

SubmitAck Intake::reject_result(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker,
                                const Status& why) {
    ++file->job.incidents.rejected;
    book->workers.unit_failed(worker, why.message(), office_.now());
    unit_failed(book, file, key, units.fail(key, worker.index, worker.successes), why, office_.now());
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
        case UnitTable::Completion::kDuplicateDifferent: return report_difference(book, file, key, worker.id);
        case UnitTable::Completion::kFirst: break;
    }
    return std::nullopt;
}

Result<SubmitAck> Intake::submit_partial(const std::string& worker_id, const UnitReference& unit, const EncodedPartial& encoded,
                                         Partial partial, double render_seconds) {
    return take_partial(worker_id, unit, {encoded.descriptor, encoded.payload}, std::move(partial), render_seconds);
}

std::optional<Result<SubmitAck>> Intake::look_up(const std::string& worker_id, const UnitReference& unit, const Digest& digest,
                                                 JobPtr* file, WorkerRecord* worker) {
    OpenBook book(office_);
    const auto [known, of, units] = book->take_back(worker_id, unit);  // if it has to deliver again, its heartbeats say so
    if (!known) return Result<SubmitAck>(no_worker(worker_id));
    known->last_heard = office_.now();
    *worker = *known;
    *file = of;
    if (!units) return Result<SubmitAck>(unexpected_result(not_running(unit.job_id)));
    if (!units->find(unit.key)) return Result<SubmitAck>(SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"});
    if (!units->is_done(unit.key)) return std::nullopt;
    return Result<SubmitAck>(*repeated_result(book, *file, *units, unit.key, *known, digest));
}

Result<SubmitAck> Intake::not_kept(const JobPtr& file, const UnitKey& unit, const std::string& worker_id, const Status& why) {
    if (why.code() == StatusCode::kNotFound) return SubmitAck{SubmitOutcome::kStale, "the job ended meanwhile"};
    if (why.code() == StatusCode::kAlreadyExists) {
        OpenBook book(office_);
        return report_difference(book, file, unit, worker_id);
    }
    if (why.code() == StatusCode::kResourceExhausted) pause(office_, why);
    return Status(StatusCode::kUnavailable, "the coordinator cannot keep the result now: " + why.message());
}

SubmitAck Intake::report_difference(OpenBook& book, const JobPtr& file, const UnitKey& unit, const std::string& worker_id) {
    ++file->job.incidents.duplicates_different;
    book.changed(file);
    book.note().error(
        file->job.id() + ": unit " + unit_name(unit) + " from " + worker_id +
        " differs from the bytes accepted before; one of two workers computes wrongly: compare their hosts and builds");
    return {SubmitOutcome::kDuplicateDifferent, "the unit was accepted before with other bytes"};
}

void Intake::checkpoint_if_due(OpenBook& book, const JobPtr& file, uint64_t bytes) {
    if (!office_.archive.keeps()) return;
    file->kept_bytes += bytes;
    const uint64_t state = kStateBytesPerPixel * uint64_t(file->job.spec().frame.crop.area());
    const uint64_t between = std::max(office_.options.checkpoint_bytes, 4 * state);
    if (file->in_checkpoint || file->kept_bytes < between || file->job.merged_groups() == 0) return;
    file->in_checkpoint = true;
    file->kept_bytes = 0;
    book.start(file, "to write a checkpoint of this job", [&office = office_, file, reducer = file->job.reducer()] {
        const auto serialized = [&]() -> Result<Reducer::Saved> {
            try {
                return reducer->serialize();
            } catch (const std::bad_alloc&) {  // the job does not need it
                return Status(StatusCode::kResourceExhausted, "there is too little memory for a copy of its sums");
            }
        };
        const auto saved = serialized();
        const Status status = saved.ok() ? office.archive.checkpoint(file->job.id(), *saved) : saved.status();
        crash_point("server.checkpoint-kept");
        OpenBook end(office);
        file->in_checkpoint = false;
        // Its results are all kept, and another checkpoint will be tried.
        if (!status.ok() && !file->job.ended()) end.note().warn(file->job.id() + ": no checkpoint: " + status.message());
        return Status();
    });
}

Result<SubmitAck> Intake::take_partial(const std::string& worker_id, const UnitReference& reference, const Kept& kept,
                                       Partial partial, double render_seconds) {
    JobPtr file;
    WorkerRecord sender;
    const Digest& digest = kept.descriptor.payload_digest;
    if (auto answer = look_up(worker_id, reference, digest, &file, &sender)) return *std::move(answer);
    // It is on disk before anybody is told that it is here. Two workers may do this at a time; one of them is merged.
    const Status on_disk =
        office_.archive.keep_partial(reference.job_id, reference.key, sender, render_seconds, kept.descriptor, kept.payload);
    if (!on_disk.ok()) return not_kept(file, reference.key, worker_id, on_disk);
    crash_point("server.result-kept");

    std::shared_ptr<Reducer> reducer;
    const uint32_t index = sender.index;
    WorkUnit unit;
    {
        OpenBook book(office_);
        WorkerRecord& worker = book->workers.at(index);
        if (file->job.state() != JobState::kRunning) return unexpected_result(not_running(reference.job_id));
        UnitTable* const units = file->job.open_units(reference.key);
        const auto known = units ? units->find(reference.key) : std::nullopt;
        if (!known) return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
        if (auto answer = repeated_result(book, file, *units, reference.key, worker, digest)) return *std::move(answer);
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
        office_.archive.drop_soon(job.id(), unit.key);
        unit_failed(book, file, unit.key, job.open_units()->reopen(unit.key), *why, office_.now());
        return SubmitAck{SubmitOutcome::kRejected, why->message()};
    }
    WorkerRecord& worker = book->workers.at(index);
    const UnitCounters& counters = work.counters;
    worker.delivered(job.id(), double(counters.camera_samples > 0 ? counters.camera_samples : counters.light_paths),
                     render_seconds);
    ++worker.merged;
    book->workers.unit_succeeded(worker, job.id());
    book.apply(file, job.count(work));
    checkpoint_if_due(book, file, kept.payload.size());
    note_time(file);
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

    JobPtr file;
    WorkerRecord sender;
    if (auto answer = look_up(worker_id, reference, digest, &file, &sender)) return *std::move(answer);
    bool keep = false;  // a probe measures time, and has to be made anew after a restart
    {
        OpenBook book(office_);
        UnitTable* const units = file->job.open_units(reference.key);
        if (!units) return SubmitAck{SubmitOutcome::kStale, "job " + reference.job_id + " has its training data already"};
        const auto unit = units->find(reference.key);
        if (!unit) return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
        Status problem = data.status();
        if (problem.ok()) problem = check_unit_data(*data, file->job.spec(), unit->training);
        WorkerRecord& worker = book->workers.at(sender.index);
        if (!problem.ok()) return reject_result(book, file, *units, reference.key, worker, problem);
        keep = reference.key.kind == UnitKind::kTraining && file->job.preparation().rounds_are_fixed;
    }
    if (keep) {
        const Status on_disk =
            office_.archive.keep_training(reference.job_id, reference.key, sender, trace_seconds, digest, payload);
        if (!on_disk.ok()) return not_kept(file, reference.key, worker_id, on_disk);
        crash_point("server.training-kept");
    }

    OpenBook book(office_);
    WorkerRecord* const worker = &book->workers.at(sender.index);
    const TimePoint now = office_.now();
    UnitTable* const units = file->job.open_units(reference.key);
    if (!units) return SubmitAck{SubmitOutcome::kStale, "job " + reference.job_id + " has its training data already"};
    if (auto answer = repeated_result(book, file, *units, reference.key, *worker, digest)) return *std::move(answer);
    book->workers.unit_succeeded(*worker, reference.job_id);
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

void Intake::note_time(const JobPtr& file) {
    const double limit = file->job.spec().time_limit_seconds;
    const TimePoint now = office_.now();
    if (limit <= 0 || seconds_between(file->spent_noted, now) < std::max(kSpentSeconds, kSpentShare * limit)) return;
    file->spent_noted = now;
    office_.archive.spent_soon(file->job.id(), file->job.preparation().learning_seconds, file->job.rendering_seconds(now));
}

}  // namespace lightloom
