#include "server/coordinator.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <random>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "common/path/path_view.h"
#include "server/job_record.h"
#include "server/results.h"

namespace lightloom {
namespace {

constexpr std::chrono::milliseconds kTick(20);

/// Ids must be unique, also across restarts of the coordinator.
std::string new_id(const char* prefix) {
    std::random_device device;
    const uint64_t bits = (uint64_t(device()) << 32) ^ device();
    char text[48];
    std::snprintf(text, sizeof text, "%s-%012llx", prefix, static_cast<unsigned long long>(bits >> 16));
    return text;
}

Status no_job(const std::string& id) {
    return not_found("no job has the id '" + id +
                     "'; a name is only a label: `lightloom list` shows the ids of those that exist (the oldest that ended are "
                     "forgotten)");
}

}  // namespace

Coordinator::Coordinator(CoordinatorOptions options)
    : options_(std::move(options)),
      assets_(options_.directory / "assets"),
      table_cache_(options_.table_cache, options_.table_cache_bytes),
      workers_(options_.lease_seconds),
      ticker_([this](std::stop_token stop) { tick(stop); }) {
    // Jobs do not outlive the coordinator, so that nothing refers to tables that are found at the start.
    if (const size_t count = assets_.remove_all_that_begin_with(kTablesPrefix); count > 0)
        log_info("removed the tables of {} earlier job(s)", count);
}

Coordinator::~Coordinator() {
    {
        const std::lock_guard lock(mutex_);
        closing_ = true;
        for (const auto& job : jobs_) {
            job->prepare_task.request_stop();
            job->train_task.request_stop();
        }
    }
    work_changed_.notify_all();
    job_changed_.notify_all();
    ticker_ = {};
    // A job joins its tasks when it is destroyed. These may still take the mutex and look through the lists, which are
    // empty by then.
    for (;;) {
        std::vector<std::shared_ptr<JobRecord>> jobs;
        std::vector<std::shared_ptr<void>> garbage;
        {
            const std::lock_guard lock(mutex_);
            jobs.swap(jobs_);
            garbage.swap(discarded_);
        }
        if (jobs.empty() && garbage.empty()) break;
    }
}

std::shared_ptr<JobRecord> Coordinator::find_job(const std::string& job_id) const {
    for (const auto& job : jobs_) {
        if (job->id == job_id) return job;
    }
    return nullptr;
}

void Coordinator::changed(JobRecord& job) {
    ++job.revision;
    job_changed_.notify_all();
}

Result<JobSpec> Coordinator::canonical_spec(const JobSpec& spec) const {
    JobSpec out = spec;
    out.frame = {};
    out.algorithm = spec.algorithm.completed();
    if (spec.samples_per_pixel > 0 && spec.time_limit_seconds > 0)
        return invalid_argument("a job has a number of samples per pixel or a time limit, not both");
    if (spec.samples_per_pixel == 0 && spec.time_limit_seconds == 0 && spec.noise_target == 0)
        return invalid_argument("a job needs a number of samples per pixel, a time limit or a noise target");
    if (spec.noise_target != 0 && !(spec.noise_target >= JobSpec::kMinNoiseTarget && spec.noise_target <= JobSpec::kMaxNoiseTarget))
        return invalid_argument("the noise target is a relMSE between 1e-9 and 1");
    if (spec.noise_target > 0 && spec.samples_per_pixel > 0 && spec.samples_per_pixel < NoiseEstimate::kLeastGroups)
        return invalid_argument("a noise target needs " + std::to_string(NoiseEstimate::kLeastGroups) +
                                " samples per pixel at least, from as many groups of which the noise is estimated");
    if (spec.samples_per_pixel > JobSpec::kMaxSamplesPerPixel)
        return invalid_argument("at most " + std::to_string(JobSpec::kMaxSamplesPerPixel) + " samples per pixel");
    if (!(spec.time_limit_seconds >= 0 && spec.time_limit_seconds <= 30 * 86400.0))
        return invalid_argument("the time limit must lie between 0 and 30 days");
    if (spec.max_depth < -1 || spec.max_depth >= kMaxEdges)
        return invalid_argument("max depth must lie between 0 and " + std::to_string(kMaxEdges - 1));
    if (spec.width < 0 || spec.height < 0 || spec.width > kMaxFrameSide || spec.height > kMaxFrameSide ||
        (spec.width == 0) != (spec.height == 0))
        return invalid_argument("a resolution needs a width and a height between 1 and " + std::to_string(kMaxFrameSide));
    return out;
}

Result<std::string> Coordinator::check_assets(const JobSpec& spec) const {
    const Digest& root = spec.scene_root;
    if (!options_.read_scene) return internal_error("this coordinator has no scene reader");
    if (!assets_.contains(root)) return failed_precondition("the scene's file list " + root.hex() + " was not uploaded");
    const auto text = assets_.read(root);
    if (!text.ok()) return text.status();
    const auto manifest = AssetManifest::parse(*text);
    if (!manifest.ok()) return manifest.status();
    for (const AssetEntry& entry : manifest->entries) {
        if (options_.scene_files_needed && !assets_.contains(entry.digest))
            return failed_precondition("\"" + entry.path + "\" of the scene was not uploaded");
    }
    return manifest->main;
}

Result<JobInfo> Coordinator::submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label) {
    if (request_id.empty() || request_id.size() > 128) return invalid_argument("a request id has 1 to 128 characters");
    LL_RETURN_IF_ERROR(check_label(label));
    const auto repeated = [&]() -> std::optional<Result<JobInfo>> {
        const auto known = requests_.find(request_id);
        if (known == requests_.end()) return std::nullopt;
        if (same_request(known->second->submitted, spec)) return Result<JobInfo>(known->second->info(options_.clock()));
        return Result<JobInfo>(
            Status(StatusCode::kAlreadyExists, "request " + request_id + " was used for another job; use a new id"));
    };
    {
        const std::lock_guard lock(mutex_);
        if (auto answer = repeated()) return *answer;
    }
    const auto canonical = canonical_spec(spec);
    if (!canonical.ok()) return canonical.status();
    auto scene = check_assets(spec);
    if (!scene.ok()) return scene.status();

    const std::lock_guard lock(mutex_);
    if (auto answer = repeated()) return *answer;
    const auto unended = std::count_if(jobs_.begin(), jobs_.end(), [](const auto& j) { return !is_terminal(j->state); });
    if (size_t(unended) >= options_.max_jobs)
        return Status(StatusCode::kResourceExhausted,
                      "the coordinator has no room for more jobs; submit again when some have ended");
    auto record = std::make_shared<JobRecord>();
    JobRecord& job = *record;
    job.id = new_id("job");
    job.request_id = request_id;
    job.submitted = spec;
    job.label = label;
    job.scene = *std::move(scene);
    job.spec = *canonical;
    job.created = options_.clock();
    job.created_at = utc_now();
    job.directory = options_.directory / "jobs" / job.id;
    jobs_.push_back(std::move(record));
    requests_[request_id] = &job;
    log_info("{}: accepted, {} {}", job.id, spec.algorithm.name(), job.spec.scene_root.hex().substr(0, 12));
    crash_point("server.job-accepted");
    start_task(job, &job.prepare_task, "to prepare this job: its scene or frame is too large",
               [this, &job](std::stop_token stop) { return prepare(job, stop); });
    return job.info(options_.clock());
}

Result<JobInfo> Coordinator::get_job(const std::string& job_id) const {
    const std::lock_guard lock(mutex_);
    const auto job = find_job(job_id);
    return job ? Result<JobInfo>(job->info(options_.clock())) : no_job(job_id);
}

std::vector<JobInfo> Coordinator::list_jobs() const {
    const std::lock_guard lock(mutex_);
    std::vector<JobInfo> out;
    for (const auto& job : jobs_) out.push_back(job->info(options_.clock()));
    return out;
}

Result<JobInfo> Coordinator::cancel_job(const std::string& job_id) {
    const std::lock_guard lock(mutex_);
    const auto job = find_job(job_id);
    if (!job) return no_job(job_id);
    if (!is_terminal(job->state)) {
        job->prepare_task.request_stop();
        job->train_task.request_stop();
        end_job(*job, JobState::kCancelled);
    }
    return job->info(options_.clock());
}

Result<JobInfo> Coordinator::wait_job(const std::string& job_id, uint64_t after_revision, double timeout_seconds) const {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<const JobRecord> job = find_job(job_id);
    if (!job) return no_job(job_id);
    job_changed_.wait_for(lock, std::chrono::duration<double>(timeout_seconds),
                          [&] { return closing_ || job->revision > after_revision; });
    if (closing_) return Status(StatusCode::kUnavailable, "the coordinator is going down");
    return job->info(options_.clock());
}

Status Coordinator::wait_job_end(const std::string& job_id, double timeout_seconds) const {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<const JobRecord> job = find_job(job_id);
    if (!job) return no_job(job_id);
    job_changed_.wait_for(lock, std::chrono::duration<double>(timeout_seconds),
                          [&] { return closing_ || is_terminal(job->state); });
    return {};
}

Result<std::string> Coordinator::image(const std::string& job_id, ImageKind kind) const {
    if (kind == ImageKind::kPreview) {
        auto made = preview(job_id, PreviewFormat::kPng);
        if (!made.ok()) return made.status();
        return std::move(made->bytes);
    }
    std::filesystem::path directory;
    {
        const std::lock_guard lock(mutex_);
        const auto job = find_job(job_id);
        if (!job) return no_job(job_id);
        if (job->state != JobState::kSucceeded)
            return failed_precondition("job " + job_id + " is " + std::string(to_string(job->state)) +
                                       "; its image exists once it has succeeded");
        directory = job->directory;
    }
    return read_image(directory);
}

Result<Preview> Coordinator::preview(const std::string& job_id, PreviewFormat format, double exposure) const {
    const std::lock_guard one_at_a_time(preview_mutex_);
    std::shared_ptr<Reducer> reducer;
    std::filesystem::path directory;
    JobSpec spec;
    {
        const std::lock_guard lock(mutex_);
        const auto job = find_job(job_id);
        if (!job) return no_job(job_id);
        const std::string what = "job " + job_id + " is " + std::string(to_string(job->state));
        if (job->state == JobState::kPreparing)
            return failed_precondition(what + " (" + phase_text(job->info(options_.clock())) + "): there is no image yet");
        if (!job->reducer && job->state != JobState::kSucceeded)
            return failed_precondition(what + ": what was rendered of it is gone");
        reducer = job->reducer;
        directory = job->directory;
        spec = job->spec;
    }
    try {
        auto made = make_preview(spec, directory, reducer.get(), format, exposure);
        if (made.ok()) return made;
        return Status(made.status().code(), "job " + job_id + ": " + made.status().message());
    } catch (const std::bad_alloc&) {  // it must not end the coordinator
        return Status(StatusCode::kResourceExhausted, "the coordinator has too little memory for a preview of job " + job_id);
    }
}

Result<std::string> Coordinator::manifest(const std::string& job_id) const {
    std::filesystem::path directory;
    {
        const std::lock_guard lock(mutex_);
        const auto job = find_job(job_id);
        if (!job) return no_job(job_id);
        if (job->state != JobState::kSucceeded)
            return failed_precondition("job " + job_id + " is " + std::string(to_string(job->state)) +
                                       "; its manifest exists once it has succeeded");
        directory = job->directory;
    }
    return read_file((directory / "manifest.json").string());
}

void Coordinator::end_job(JobRecord& job, JobState state) {
    if (job.state == JobState::kPreparing || job.state == JobState::kRunning) job.finishing = options_.clock();
    job.state = state;
    job.ended = options_.clock();
    if (job.units) {
        job.ended_units = {job.units->unit_total(), job.units->done_count()};
        discarded_.push_back(std::make_shared<UnitTable>(*std::move(job.units)));
        job.units.reset();
    }
    discard_training(job);
    if (const auto maker = std::exchange(job.maker, nullptr)) {
        if (is_terminal(maker->state)) drop_tables(maker->tables_asset);  // they were kept for this job
        discarded_.push_back(maker);
    }
    drop_tables(job.tables_asset);
    drop_tables(job.guide.digest);
    job.guide_bytes.reset();
    if (job.reducer) discarded_.push_back(std::move(job.reducer));
    discarded_.push_back(std::make_shared<std::vector<ImageLayer>>(std::move(job.layers)));
    job.reducer.reset();
    log_info("{}: {}{}{}", job.id, to_string(state), job.message.empty() ? "" : ": ", job.message);
    crash_point("server.job-ended");
    changed(job);
}

void Coordinator::fail_job(JobRecord& job, const Status& why) {
    if (is_terminal(job.state)) return;
    job.message = why.message();
    end_job(job, JobState::kFailed);
}

void Coordinator::unit_failed(JobRecord& job, const UnitKey& key, UnitTable::Failures failures, const Status& why) {
    const std::string unit = unit_name(key);
    log_warn("{}: unit {} failed ({}): {}", job.id, unit, failures.total, why.message());
    // Units are pure functions: a request that is wrong is wrong on every worker.
    if (failures.workers >= kMaxFailedWorkers || failures.total >= kMaxUnitFailures || why.code() == StatusCode::kInvalidArgument)
        fail_job(job, {why.code(), "unit " + unit + ": " + why.message()});
    work_changed_.notify_all();
}

void Coordinator::leases_expired(JobRecord& job, UnitTable& units, const std::vector<UnitTable::Expired>& expired) {
    job.expired_leases += expired.size();
    log_warn("{}: {} lease(s) ran out; the units go to other workers", job.id, expired.size());
    work_changed_.notify_all();
    for (const UnitTable::Expired& lease : expired) {
        // Of the units that a silent worker held, the oldest was being rendered and counts as the cause; the others
        // waited behind it.
        if (!workers_.fell_silent(lease.worker, options_.clock())) continue;
        const std::set<uint32_t> lost = units.lose(lease.unit, lease.worker);
        if (lost.size() < kMaxLostWorkers) continue;
        std::string names;
        for (const uint32_t index : lost) names += (names.empty() ? "" : ", ") + workers_.at(index).id;
        return fail_job(job, {StatusCode::kAborted, "unit " + unit_name(lease.unit) + ": " + std::to_string(lost.size()) +
                                                        " workers fell silent over it (" + names +
                                                        "); it may crash them or exhaust their memory, see their logs"});
    }
}

void Coordinator::forget_old_jobs() {
    size_t ended = 0;
    for (const auto& job : jobs_) ended += is_terminal(job->state);
    if (ended <= options_.kept_jobs) return;
    size_t surplus = ended - options_.kept_jobs;
    std::erase_if(jobs_, [&](const std::shared_ptr<JobRecord>& job) {
        if (surplus == 0 || !is_terminal(job->state) || job->running_tasks > 0) return false;
        --surplus;
        requests_.erase(job->request_id);
        log_info("{}: forgotten; {} newer jobs have ended", job->id, options_.kept_jobs);
        discarded_.push_back(job);
        return true;
    });
}

void Coordinator::tick(std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        work_changed_.wait_for(lock, kTick);
        const TimePoint now = options_.clock();
        for (const auto& job : jobs_) {
            if (job->maker) resume_waiting(job);
            if (job->waits()) job->stop_clock(now);
            UnitTable* const units = job->open_units();
            if (!units) continue;
            if (const auto expired = units->expire(now); !expired.empty()) {
                leases_expired(*job, *units, expired);
                if (is_terminal(job->state)) continue;
            }
            if (job->spec.time_limit_seconds > 0 && job->rendering && !job->closed && job->seconds_left(now) <= 0) {
                job->closed = true;
                finish_if_complete(*job);
            }
        }
        forget_old_jobs();
        if (discarded_.empty()) continue;
        auto garbage = std::move(discarded_);
        discarded_.clear();
        lock.unlock();
        garbage.clear();
        lock.lock();
    }
}

}  // namespace lightloom
