#include "server/job_record.h"

#include <algorithm>
#include <utility>

namespace lightloom {
namespace {

constexpr uint64_t kLearningSteps = 1000;  ///< Steps into which the progress of learning is divided.

/// Remaining time for `whole` when `done` of it took `seconds` of steady work; nothing while `done` is 0.
std::optional<double> seconds_left(double seconds, uint64_t done, uint64_t whole) {
    if (done == 0) return std::nullopt;
    return seconds * double(whole - done) / double(done);
}

void tell_rendering(const JobRecord& job, TimePoint now, JobInfo* info) {
    if (!job.rendering) return;
    const bool ended = is_terminal(job.state);
    const bool over = ended || job.state == JobState::kFinishing;
    info->render_seconds = seconds_between(job.first_render, over ? job.finishing : now);
    if (ended) info->finish_seconds = seconds_between(job.finishing, job.ended);
    if (over) {
        info->eta_seconds = 0;
    } else if (job.spec.time_limit_seconds > 0) {
        info->eta_seconds = std::max(0.0, job.seconds_left(now));
    } else if (const double share = sample_share(*info); share > 0) {
        info->eta_seconds = info->render_seconds * (1 - share) / share;
    }
    if (const auto share = noise_share(*info); share && !over) {
        const double left = info->render_seconds * (1 - *share) / *share;
        info->eta_seconds = info->eta_seconds < 0 ? left : std::min(info->eta_seconds, left);
    }
}

void tell_preparation(const JobRecord& job, TimePoint now, JobInfo* info) {
    info->phase = job.phase;
    if (job.prepared != TimePoint()) info->prepare_seconds = seconds_between(job.created, job.prepared);
    if (job.maker) {
        info->waits_for = job.maker->id;
        info->eta_seconds = job.maker->info(now).eta_seconds;
    }
    std::optional<double> left;
    if (job.phase == PreparePhase::kLearning && job.state == JobState::kPreparing) {
        info->phase_total = kLearningSteps;
        info->phase_done = uint64_t(double(kLearningSteps) * job.learning.share);
        left = job.learning.seconds_left(now);
    } else if (job.round) {
        info->unit_leased = job.round->units().leased_count();
        info->phase_total = job.round->work().total_samples;
        info->phase_done = job.round->samples_done();
        if (job.phase == PreparePhase::kTracing)
            left = seconds_left(seconds_between(job.training_begin, now), info->phase_done, info->phase_total);
    }
    if (left) info->eta_seconds = *left;
}

}  // namespace

std::optional<double> JobRecord::Learning::seconds_left(TimePoint now) const {
    if (!(share > 0)) return std::nullopt;
    return std::max(0.0, seconds_between(begin, heard) * (1 - share) / share - seconds_between(heard, now));
}

double JobRecord::seconds_left(TimePoint now) const {
    const bool learns = state == JobState::kPreparing && work_begin != TimePoint();
    const double learned = learning_seconds + (learns ? seconds_between(work_begin, now) : 0);
    return spec.time_limit_seconds - learned - (rendering ? seconds_between(first_render, now) : 0);
}

void JobRecord::stop_clock(TimePoint now) {
    if (work_begin != TimePoint()) learning_seconds += seconds_between(std::exchange(work_begin, {}), now);
}

bool JobRecord::waits() const {
    if (state != JobState::kPreparing || !round) return false;
    return round->complete() ? !scene_built : round->units().leased_count() == 0;
}

JobInfo JobRecord::info(TimePoint now) const {
    JobInfo info;
    info.job_id = id;
    info.state = state;
    info.spec = spec;
    info.algorithm = spec.algorithm.name();
    info.message = message;
    info.revision = revision;
    info.unit_total = only_noise_bounds(spec) ? 0 : units ? units->unit_total() : ended_units.total;
    info.unit_done = units ? units->done_count() : ended_units.done;
    info.unit_leased = units ? units->leased_count() : 0;
    info.samples_per_pixel_done = merged_iterations;
    info.dropped_samples = dropped;
    info.camera_samples = counters.camera_samples;
    info.light_paths = counters.light_paths;
    info.rays = counters.rays;
    info.worker_count = uint32_t(workers.size());
    info.image_digest = image_digest;
    info.image_size_bytes = image_size;
    info.duplicates_same = duplicates_same;
    info.duplicates_different = duplicates_different;
    info.tables = tables;
    info.rare_light = rare_light_report;
    info.noise = noise;
    info.label = label;
    info.scene = scene;
    info.age_seconds = seconds_between(created, now);
    tell_rendering(*this, now, &info);
    tell_preparation(*this, now, &info);
    return info;
}

UnitTable* JobRecord::open_units() {
    if (state == JobState::kRunning) return &*units;
    return state == JobState::kPreparing && round ? &round->units() : nullptr;
}

UnitTable* JobRecord::open_units(const UnitKey& unit) {
    UnitTable* const table = open_units();
    if (!table) return nullptr;
    if (state == JobState::kRunning) return unit.kind == UnitKind::kRender ? table : nullptr;
    return unit == round->key(unit.group) ? table : nullptr;
}

const std::shared_ptr<JobRecord>& maker_of_last_resort(const std::shared_ptr<JobRecord>& job) {
    const std::shared_ptr<JobRecord>* maker = &job;
    while ((*maker)->maker) maker = &(*maker)->maker;
    return *maker;
}

}  // namespace lightloom
