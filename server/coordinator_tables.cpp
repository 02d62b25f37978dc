// Tables: the part of a job's life in which workers trace its training set and the coordinator learns from it. Training
// units are leased, renewed, given back and merged exactly once like units of the image; their order of arrival does
// not matter, because the data are joined in the order of their numbers.

#include <algorithm>
#include <chrono>
#include <thread>

#include "common/cli/log_line.h"
#include "common/core/crash_point.h"
#include "common/transport/parameters.h"
#include "server/coordinator.h"
#include "server/job_record.h"
#include "server/training_budget.h"

namespace lightloom {

void Coordinator::discard_training(JobRecord& job) {
    discarded_.push_back(std::make_shared<SceneFacts>(std::exchange(job.facts, {})));
    discard_round(job);
}

void Coordinator::discard_round(JobRecord& job) {
    if (!job.round) return;
    discarded_.push_back(std::make_shared<TrainingRound>(*std::move(job.round)));
    job.round.reset();
}

void Coordinator::open_training(JobRecord& job, UnitKind kind, uint32_t round, const TrainingWork& work) {
    job.round.emplace(kind, round, work, options_.shuffle_seed);
    job.round_begin = {};
    job.phase = kind == UnitKind::kProbe ? PreparePhase::kProbing : PreparePhase::kTracing;
    prepared_further(job);
    work_changed_.notify_all();
}

Status Coordinator::prepare_tables(JobRecord& job, JobSpec spec, SceneFacts facts, bool may_wait) {
    if (spec.samples_per_pixel > 0 && spec.algorithm.has(kTrainingPaths) && !job.submitted.algorithm.chosen(kTrainingPaths)) {
        const uint64_t image_samples = uint64_t(spec.frame.crop.area()) * spec.samples_per_pixel;
        const uint64_t samples = proportionate_training_samples(image_samples, learning_plan(spec.algorithm).samples);
        spec.algorithm = spec.algorithm.with(kTrainingPaths, double(samples));
    }
    if (adopt_cached_tables(job, spec, facts)) return {};
    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kPreparing) return {};
    // A training set that the user chose is not made smaller, and neither is one that a probe has already chosen.
    const bool chosen = job.submitted.algorithm.chosen(kTrainingPaths) || job.capped_by_time_limit;
    const bool open_size = spec.time_limit_seconds > 0 && !chosen && spec.algorithm.has(kTrainingPaths);
    const uint64_t samples = learning_plan(spec.algorithm).samples;
    job.table_key = table_key(options_.identity, spec);
    job.spec = std::move(spec);
    job.facts = std::move(facts);
    // Another job may take far longer to make the tables than this one's limit allows: therefore this job probes first,
    // see settle().
    const bool probes = open_size && samples > kMinTrainingSamples;
    job.may_wait = may_wait;
    if (may_wait && !probes && wait_for_maker(job)) return {};
    job.makes_tables = true;
    if (probes) {
        const auto roomy = uint64_t(std::min(job.spec.time_limit_seconds * kProbeSamplesPerSecond, double(kTrainingUnitSamples)));
        const uint64_t probe = std::min(std::max(kProbeSamples, roomy), samples);
        open_training(job, UnitKind::kProbe, 0, {0, probe, probe});
    } else {
        open_first_round(job);
    }
    return {};
}

std::shared_ptr<JobRecord> Coordinator::find_maker(const JobRecord& job) const {
    for (const auto& other : jobs_) {
        // While it probes, or its set grows, a job does not know yet for which set.
        const bool makes =
            other->makes_tables && !is_terminal(other->state) && other->phase != PreparePhase::kProbing && !other->set_grows;
        if (other.get() != &job && makes && other->table_key == job.table_key) return other;
    }
    return nullptr;
}

bool Coordinator::wait_for_maker(JobRecord& job) {
    job.maker = find_maker(job);
    if (!job.maker) return false;
    // The state is that before its own tracing, in case the job has to begin again.
    job.makes_tables = false;
    job.training_begin = job.work_begin = {};
    job.learning_seconds = 0;
    discard_round(job);
    job.phase = PreparePhase::kWaitingForTables;
    log_info("{}: waits for the tables of {}", job.id, job.maker->id);
    prepared_further(job);
    return true;
}

void Coordinator::resume_waiting(const std::shared_ptr<JobRecord>& job) {
    // A time-limited maker may settle for a smaller training set, which makes other tables.
    const JobRecord& maker = *job->maker;
    const bool making = maker.state == JobState::kPreparing && maker.table_key == job->table_key;
    if (making || closing_ || job->running_tasks > 0) return;
    JobRecord& record = *job;
    start_task(record, &record.prepare_task, "to prepare this job: its frame or tables are too large",
               [this, &record](std::stop_token) { return take_over_tables(record); });
}

void Coordinator::prepared_further(JobRecord& job) {
    changed(job);
    for (const auto& other : jobs_)
        for (const JobRecord* maker = other->maker.get(); maker; maker = maker->maker.get())
            if (maker == &job) changed(*other);
}

Status Coordinator::take_over_tables(JobRecord& job) {
    JobSpec spec;
    SceneFacts facts;
    TablesInfo tables;
    std::shared_ptr<JobRecord> maker;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return {};
        maker = std::move(job.maker);
        if (maker->tables.cache_key == job.table_key) {
            tables = maker->tables;
            job.tables_asset = maker->tables_asset;
        }
        spec = job.spec;
        facts = std::move(job.facts);
        job.phase = PreparePhase::kReadingScene;
        changed(job);
    }
    maker.reset();  // without the mutex: this may end the other job, which joins its tasks
    if (tables.asset.size_bytes == 0) return prepare_tables(job, std::move(spec), std::move(facts), true);
    const auto bytes = assets_.read(tables.asset.digest);
    if (!bytes.ok()) return prepare_tables(job, std::move(spec), std::move(facts), false);
    tables.from_cache = true;
    tables.capped_by_time_limit = job.capped_by_time_limit;
    return adopt_tables(job, spec, facts, *bytes, std::move(tables));
}

bool Coordinator::adopt_cached_tables(JobRecord& job, const JobSpec& spec, const SceneFacts& facts) {
    const Digest key = table_key(options_.identity, spec);
    auto entry = table_cache_.find(key, spec.algorithm.learning()->parts);
    if (!entry) return false;
    log_info("{}: tables {} of an earlier job are used again", job.id, entry->info.asset.digest.hex().substr(0, 12));
    entry->info.capped_by_time_limit = job.capped_by_time_limit;
    if (const Status s = adopt_tables(job, spec, facts, entry->bytes, std::move(entry->info)); !s.ok()) {
        const std::lock_guard lock(mutex_);
        fail_job(job, s);
    }
    return true;
}

Status Coordinator::store_tables(const Digest& digest, std::string_view bytes) {
    if (assets_.contains(digest) && !assets_.read(digest).ok()) assets_.remove(digest);
    Status stored = assets_.put(digest, bytes);
    // Another job with the same tables may be storing them at this moment.
    for (int i = 0; i < 100 && stored.code() == StatusCode::kAborted; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        stored = assets_.put(digest, bytes);
    }
    return stored;
}

Status Coordinator::adopt_tables(JobRecord& job, const JobSpec& spec, const SceneFacts& facts, std::string_view bytes,
                                 TablesInfo tables) {
    const Digest digest = sha256(bytes);
    tables.asset = {digest, bytes.size()};
    {
        const std::lock_guard lock(mutex_);
        if (is_terminal(job.state)) return {};
        job.tables_asset = digest;  // set before the bytes are stored, so that no job that ends removes them
    }
    LL_RETURN_IF_ERROR(store_tables(digest, bytes));
    crash_point("server.tables-stored");
    plan_units(job, spec, facts, std::move(tables));
    const std::lock_guard lock(mutex_);
    job.guide_bytes.reset();
    drop_tables(std::exchange(job.guide, {}).digest);
    if (is_terminal(job.state)) drop_tables(digest);  // the job ended while they were stored
    return {};
}

void Coordinator::drop_tables(const Digest& digest) {
    if (digest == Digest()) return;
    for (const auto& other : jobs_) {
        const bool waits = other->maker && other->maker->tables_asset == digest;
        const bool names = other->tables_asset == digest || other->guide.digest == digest;
        if (waits || (!is_terminal(other->state) && names)) return;
    }
    assets_.remove(digest);
}

Result<uint64_t> Coordinator::expected_training_bytes(const UnitReference& reference) const {
    const std::lock_guard lock(mutex_);
    const auto job = find_job(reference.job_id);
    UnitTable* const units = job ? job->open_units(reference.key) : nullptr;
    if (!units || reference.key.kind == UnitKind::kRender)
        return not_found("job " + reference.job_id + " takes no such training data (any more)");
    const auto unit = units->find(reference.key);
    if (!unit) return invalid_argument("job " + reference.job_id + " has leased no such unit");
    return largest_training_payload(job->spec, unit->training);
}

Result<SubmitAck> Coordinator::submit_training(const std::string& worker_id, const UnitReference& reference, const Digest& digest,
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

    const std::lock_guard lock(mutex_);
    WorkerRecord* worker = workers_.find(worker_id);
    if (!worker) return no_worker(worker_id);
    worker->last_heard = options_.clock();
    worker->held.erase(reference);
    const auto job = find_job(reference.job_id);
    UnitTable* const units = job ? job->open_units(reference.key) : nullptr;
    if (!units) return SubmitAck{SubmitOutcome::kStale, "job " + reference.job_id + " has its training data already"};
    const auto unit = units->find(reference.key);
    if (!unit) return SubmitAck{SubmitOutcome::kRejected, "no such unit was leased"};
    Status problem = data.status();
    if (problem.ok()) problem = check_unit_data(*data, job->spec, unit->training);
    if (!problem.ok()) return reject_result(*job, *units, reference.key, *worker, problem);
    if (auto answer = repeated_result(*job, *units, reference.key, *worker, digest)) return *std::move(answer);
    workers_.unit_succeeded(*worker);
    // A short unit may be over before a heartbeat tells of it.
    if (job->work_begin == TimePoint()) job->work_begin = seconds_after(options_.clock(), -trace_seconds);
    TrainingRound& round = *job->round;
    round.add(reference.key.group, {*std::move(data), payload.size(), trace_seconds});
    // A set that is far too large is noticed before hours are spent on it.
    if (round.bytes() > options_.training_bytes || round.projected_bytes() > 1.25 * double(options_.training_bytes)) {
        fail_job(*job, {StatusCode::kResourceExhausted,
                        "the training data need more than the " + std::to_string(options_.training_bytes >> 20) +
                            " MiB that a job may have; choose fewer training-paths or energy-paths"});
        return SubmitAck{SubmitOutcome::kRejected, job->message};
    }
    prepared_further(*job);
    work_changed_.notify_all();
    crash_point("server.training-counted");
    return SubmitAck{SubmitOutcome::kAccepted, {}};
}

bool Coordinator::repair_tables(const std::string& job_id) {
    std::shared_ptr<JobRecord> job;
    std::shared_ptr<const std::string> guide;
    AssetReference asset;
    Digest cache_key;
    std::span<const TablePart* const> parts;
    {
        const std::lock_guard lock(mutex_);
        job = find_job(job_id);
        if (!job || is_terminal(job->state) || !job->spec.algorithm.learning()) return false;
        parts = job->spec.algorithm.learning()->parts;
        guide = job->guide_bytes;
        asset = guide ? job->guide : job->tables.asset;
        cache_key = job->tables.cache_key;
    }
    const Digest& digest = asset.digest;
    if (asset.size_bytes == 0) return false;
    const std::lock_guard only_one(repair_mutex_);
    if (assets_.read(digest).ok()) return false;  // it is the worker's own trouble, or was repaired meanwhile
    assets_.remove(digest);
    const auto entry = guide ? std::nullopt : table_cache_.find(cache_key, parts);
    const bool cached = entry && entry->info.asset.digest == digest;
    const Status stored = guide    ? assets_.put(digest, *guide)
                          : cached ? assets_.put(digest, entry->bytes)
                                   : data_loss("no other copy is left; submit the job again");
    if (stored.ok() || stored.code() == StatusCode::kAborted) {
        log_warn("{}: tables {} were damaged on disk and are restored", job_id, digest.hex().substr(0, 12));
        const std::lock_guard lock(mutex_);
        if (is_terminal(job->state)) drop_tables(digest);  // the job ended meanwhile
        return true;
    }
    const std::lock_guard lock(mutex_);
    fail_job(*job, data_loss("the tables are damaged on the coordinator's disk: " + stored.message()));
    return false;
}

}  // namespace lightloom
