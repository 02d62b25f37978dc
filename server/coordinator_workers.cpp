// The coordinator's side of a worker's life: registration, leases, heartbeats and results.

#include "common/cli/log_line.h"
#include "common/core/crash_point.h"
#include "server/coordinator.h"
#include "server/job_record.h"

namespace lightloom {
namespace {

std::string describe(const BuildIdentity& identity) {
    return "build " + identity.build_id + ", math profile \"" + identity.math_profile + "\", golden unit " +
           identity.golden_digest.hex().substr(0, 16);
}

Status not_running(const std::string& job_id) { return not_found("job " + job_id + " is not running (any more)"); }

}  // namespace

SubmitAck unexpected_result(const Status& why) {
    return {why.code() == StatusCode::kNotFound ? SubmitOutcome::kStale : SubmitOutcome::kRejected, why.message()};
}

Result<WorkerGrant> Coordinator::register_worker(const WorkerHello& hello) {
    if (hello.thread_count == 0) return invalid_argument("a worker needs at least one thread");
    if (hello.identity != options_.identity) {
        const Status refusal = failed_precondition(
            "this worker could render other pixels than the coordinator and is refused: worker has " + describe(hello.identity) +
            "; coordinator has " + describe(options_.identity) + "; install the same build on both hosts");
        log_error("worker on {} (process {}): {}", hello.host, hello.process_id, refusal.message());
        const std::lock_guard lock(mutex_);
        workers_.refuse(hello, refusal.message(), options_.clock());
        return refusal;
    }
    const std::lock_guard lock(mutex_);
    const WorkerRecord& worker = workers_.add(hello, options_.clock());
    log_info("{}: registered, {} thread(s)", worker.id, hello.thread_count);
    return WorkerGrant{worker.id, options_.heartbeat_seconds, options_.lease_seconds};
}

std::optional<UnitLease> Coordinator::next_unit(WorkerRecord& worker) {
    const TimePoint now = options_.clock();
    if (!worker.has_room() || workers_.rests(worker, now)) return std::nullopt;
    const auto anyone_else = [&](const std::set<uint32_t>& but) { return workers_.anyone_else(but, now); };
    // A worker gets a second unit only if enough are left for the workers that have none: a unit must not wait behind
    // another one while a worker idles.
    const size_t idle = worker.held.empty() ? 0 : workers_.idle();
    for (const auto& in_line : jobs_) {
        // A job that waits for tables gives its turn to the job that makes them, which may be a younger one.
        const std::shared_ptr<JobRecord> job = maker_of_last_resort(in_line);
        if (job != in_line && job->state != JobState::kPreparing) continue;
        UnitTable* const units = job->open_units();
        if (!units || (!worker.held.empty() && !units->has_more_than(idle))) continue;
        const auto unit = units->lease(worker.index, lease_end(), anyone_else);
        if (!unit) continue;
        const bool render = unit->key.kind == UnitKind::kRender;
        if (!render && job->round_begin == TimePoint()) job->round_begin = now;
        if (!render && job->training_begin == TimePoint()) {
            // Learning takes a thread and a built scene only from the first lease on; both are made while paths are
            // traced.
            job->training_begin = job->round_begin;
            JobRecord& record = *job;
            if (!start_task(record, &record.train_task,
                            "to learn the tables of this job; choose fewer training-paths, energy-paths or subspaces",
                            [this, &record](std::stop_token stop) { return learn(record, stop); }))
                continue;
        }
        worker.held.insert({job->id, unit->key});
        crash_point("server.unit-leased");
        if (!render && job->learning_seconds > 0 && job->work_begin == TimePoint()) job->work_begin = now;  // it goes on
        if (render) return UnitLease{job->id, job->spec, *unit, job->tables.asset};
        return UnitLease{job->id, job->spec, *unit, job->guide};
    }
    return std::nullopt;
}

Result<std::vector<UnitLease>> Coordinator::lease_units(const std::string& worker_id, double wait_seconds,
                                                        const std::function<bool()>& cancelled) {
    if (!(wait_seconds >= 0)) return invalid_argument("a worker waits for 0 or more seconds");
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(std::min(wait_seconds, 5.0));
    std::unique_lock lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    ++worker->waiting;
    std::vector<UnitLease> leases;
    while (!closing_ && !worker->left && !cancelled()) {
        worker->last_heard = options_.clock();
        if (auto unit = next_unit(*worker)) {
            leases.push_back(*std::move(unit));
            break;
        }
        const auto now = std::chrono::steady_clock::now();
        if (now >= deadline) break;
        work_changed_.wait_for(lock, std::min<std::chrono::duration<double>>(deadline - now, std::chrono::milliseconds(100)));
    }
    --worker->waiting;
    if (closing_) return Status(StatusCode::kUnavailable, "the coordinator is going down");
    return leases;
}

void Coordinator::wake_leases() {
    const std::lock_guard lock(mutex_);  // between a look and the wait that follows it, nobody would hear
    work_changed_.notify_all();
}

Result<std::vector<UnitReference>> Coordinator::heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) {
    const std::lock_guard lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    worker->last_heard = options_.clock();
    std::vector<UnitReference> revoked;
    std::set<UnitReference> held;
    worker->in_work.reset();
    for (const RunningUnit& item : running) {
        const auto job = find_job(item.unit.job_id);
        UnitTable* const units = job ? job->open_units(item.unit.key) : nullptr;
        if (!units || !units->renew(item.unit.key, worker->index, lease_end())) {
            revoked.push_back(item.unit);
            continue;
        }
        held.insert(item.unit);
        if (item.rendering) worker->in_work = item.unit;
        const bool render = item.unit.key.kind == UnitKind::kRender;
        if (item.rendering && !render && job->work_begin == TimePoint()) job->work_begin = options_.clock();
        if (item.rendering && render && !job->rendering) {
            job->rendering = true;
            job->first_render = options_.clock();
            changed(*job);
        }
    }
    // A lease whose answer was lost on the way is not in `running`; it expires by itself.
    worker->held = std::move(held);
    return revoked;
}

Status Coordinator::release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) {
    const bool lost_bytes = why.code() == StatusCode::kDataLoss || why.code() == StatusCode::kNotFound;
    const bool repaired = lost_bytes && repair_tables(unit.job_id);
    const std::lock_guard lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    worker->held.erase(unit);
    const auto job = find_job(unit.job_id);
    UnitTable* const units = job ? job->open_units(unit.key) : nullptr;
    if (!units) return {};
    // Network errors say nothing about the unit and only cost time.
    const bool blameless = repaired || why.code() == StatusCode::kCancelled || why.code() == StatusCode::kUnavailable ||
                           why.code() == StatusCode::kDeadlineExceeded || why.code() == StatusCode::kAborted;
    if (why.ok() || blameless) {
        units->release(unit.key, worker->index);
    } else {
        if (why.code() != StatusCode::kInvalidArgument) workers_.unit_failed(*worker, options_.clock());  // else it is the job
        const UnitTable::Failures failures = units->fail(unit.key, worker->index);
        unit_failed(*job, unit.key, failures, {why.code(), worker->id + ": " + why.message()});
    }
    work_changed_.notify_all();
    return {};
}

Status Coordinator::goodbye(const std::string& worker_id) {
    const std::lock_guard lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    for (const auto& job : jobs_) {
        if (UnitTable* const units = job->open_units()) units->release_all(worker->index);
    }
    worker->held.clear();
    worker->left = true;
    log_info("{}: left", worker_id);
    work_changed_.notify_all();
    return {};
}

Result<PartialExpectation> Coordinator::expected_partial(const UnitReference& reference) const {
    const std::lock_guard lock(mutex_);
    const auto job = find_job(reference.job_id);
    if (!job || job->state != JobState::kRunning) return not_running(reference.job_id);
    const auto unit = reference.key.kind == UnitKind::kRender ? job->units->find(reference.key) : std::nullopt;
    if (!unit) return invalid_argument("job " + reference.job_id + " has leased no such unit");
    return PartialExpectation{job->spec.frame, unit->render.tile, unit->render.samples_per_pixel(), unit->render.light_path_count};
}

Result<SubmitAck> Coordinator::submit_payload(const std::string& worker_id, const UnitReference& unit,
                                              const PartialDescriptor& descriptor, std::string_view payload,
                                              double render_seconds) {
    crash_point("server.result-received");
    const auto expected = expected_partial(unit);
    if (!expected.ok()) return unexpected_result(expected.status());
    auto partial = decode_partial(*expected, descriptor, payload);
    if (partial.ok()) return submit_partial(worker_id, unit, descriptor.payload_digest, *std::move(partial), render_seconds);

    const std::lock_guard lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    worker->held.erase(unit);
    const auto job = find_job(unit.job_id);
    if (job && job->state == JobState::kRunning) return reject_result(*job, *job->units, unit.key, *worker, partial.status());
    return SubmitAck{SubmitOutcome::kRejected, partial.status().message()};
}

SubmitAck Coordinator::reject_result(JobRecord& job, UnitTable& units, const UnitKey& key, WorkerRecord& worker,
                                     const Status& why) {
    ++job.rejected;
    workers_.unit_failed(worker, options_.clock());
    unit_failed(job, key, units.fail(key, worker.index), why);
    return {SubmitOutcome::kRejected, why.message()};
}

std::optional<SubmitAck> Coordinator::repeated_result(JobRecord& job, UnitTable& units, const UnitKey& key,
                                                      const WorkerRecord& worker, const Digest& digest) {
    switch (units.complete(key, worker.index, digest)) {
        case UnitTable::Completion::kUnknown: return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
        case UnitTable::Completion::kDuplicateSame:
            ++job.duplicates_same;
            changed(job);
            return SubmitAck{SubmitOutcome::kDuplicateSame, {}};
        case UnitTable::Completion::kDuplicateDifferent:
            ++job.duplicates_different;
            changed(job);
            log_error(
                "{}: unit {} from {} differs from the bytes accepted before; one of two workers computes wrongly: "
                "compare their hosts and builds",
                job.id, unit_name(key), worker.id);
            return SubmitAck{SubmitOutcome::kDuplicateDifferent, "the unit was accepted before with other bytes"};
        case UnitTable::Completion::kFirst: break;
    }
    return std::nullopt;
}

Result<SubmitAck> Coordinator::submit_partial(const std::string& worker_id, const UnitReference& reference, const Digest& digest,
                                              Partial partial, double render_seconds) {
    std::shared_ptr<Reducer> reducer;
    std::shared_ptr<JobRecord> job;
    uint32_t index = 0;
    WorkUnit unit;
    {
        const std::lock_guard lock(mutex_);
        WorkerRecord* worker = workers_.find(worker_id);
        if (!worker) return no_worker(worker_id);
        worker->last_heard = options_.clock();
        worker->held.erase(reference);
        job = find_job(reference.job_id);
        if (!job || job->state != JobState::kRunning) return unexpected_result(not_running(reference.job_id));
        index = worker->index;
        const auto known = job->units->find(reference.key);
        if (auto answer = repeated_result(*job, *job->units, reference.key, *worker, digest)) return *std::move(answer);
        unit = *known;
        reducer = job->reducer;
    }
    const UnitCounters counters = partial.counters;
    const uint64_t dropped = partial.dropped_count;
    crash_point("server.before-merge");
    const auto refused = reducer->add(unit, partial);
    crash_point("server.after-merge");
    partial = {};

    const std::lock_guard lock(mutex_);
    if (job->state != JobState::kRunning) return SubmitAck{SubmitOutcome::kStale, "the job ended meanwhile"};
    if (!refused.ok()) {
        fail_job(*job, refused.status());
        return SubmitAck{SubmitOutcome::kRejected, refused.status().message()};
    }
    if (const std::optional<Status>& why = *refused) {
        ++job->rejected;
        unit_failed(*job, unit.key, job->units->reopen(unit.key), *why);
        return SubmitAck{SubmitOutcome::kRejected, why->message()};
    }
    const uint64_t samples = counters.camera_samples > 0 ? counters.camera_samples : counters.light_paths;
    workers_.at(index).delivered(job->id, double(samples), render_seconds);
    ++workers_.at(index).merged;
    workers_.unit_succeeded(workers_.at(index));
    job->workers.insert(index);
    job->counters += counters;
    job->dropped += dropped;
    const uint32_t groups = reducer->folded_groups();
    if (groups > job->merged_groups) {
        job->merged_groups = groups;
        job->merged_iterations = reducer->iterations();
        job->units->advance(groups);
    }
    if (const auto noise = reducer->noise()) {
        job->noise = noise;
        job->closed = job->closed || noise->reached;
    }
    changed(*job);
    work_changed_.notify_all();
    finish_if_complete(*job);
    crash_point("server.result-counted");
    return SubmitAck{SubmitOutcome::kAccepted, {}};
}

std::vector<WorkerStatus> Coordinator::workers(double gone_within_seconds) const {
    const std::lock_guard lock(mutex_);
    return workers_.statuses(options_.clock(), gone_within_seconds);
}

}  // namespace lightloom
