#include "server/job.h"

#include <algorithm>
#include <utility>

namespace lightloom {

Job::Job(Submission submission, JobSpec canonical, TimePoint now, const Past& past)
    : submission_(std::move(submission)),
      past_(past),
      spec_(std::move(canonical)),
      revision_(past.revision),
      created_(seconds_after(now, -past.age_seconds)) {}

Job::Job(Submission submission, const JobInfo& last, TimePoint now, const Past& past)
    : Job(std::move(submission), last.spec, now, past) {
    state_ = last.state;
    message_ = last.message;
    tables_ = last.tables;
    last_ = last;
}

double Job::rendering_seconds(TimePoint now) const {
    if (!first_render_) return past_.rendering_seconds;
    const bool over = ended() || state_ == JobState::kFinishing;
    return past_.rendering_seconds + seconds_between(*first_render_, over ? finishing_ : now);
}

void Job::tell_rendering(TimePoint now, JobInfo* info) const {
    if (!first_render_) return;
    const bool over = ended() || state_ == JobState::kFinishing;
    info->render_seconds = rendering_seconds(now);
    if (ended()) info->finish_seconds = seconds_between(finishing_, ended_);
    if (over) {
        info->eta_seconds = 0;
    } else if (spec_.time_limit_seconds > 0) {
        info->eta_seconds = std::max(0.0, seconds_left(now));
    } else if (const double share = sample_share(*info); share > 0) {
        info->eta_seconds = info->render_seconds * (1 - share) / share;
    }
    if (const auto share = noise_share(*info); share && !over) {
        const double left = info->render_seconds * (1 - *share) / *share;
        info->eta_seconds = info->eta_seconds < 0 ? left : std::min(info->eta_seconds, left);
    }
}

JobInfo Job::info(TimePoint now, const std::optional<WaitsFor>& waits_for) const {
    JobInfo info;
    if (last_) {
        info = *last_;
        info.revision = revision_;
        info.age_seconds = seconds_between(created_, now);
        return info;
    }
    info.job_id = id();
    info.state = state_;
    info.spec = spec_;
    info.algorithm = spec_.algorithm.name();
    info.message = message_;
    info.revision = revision_;
    const UnitTable* const units = units_ && !ended() ? &*units_ : nullptr;
    info.unit_total = only_noise_bounds(spec_) ? 0 : units ? units->unit_total() : ended_units_.total;
    info.unit_done = units ? units->done_count() : ended_units_.done;
    info.unit_leased = units ? units->leased_count() : 0;
    info.samples_per_pixel_done = merged_iterations_;
    info.dropped_samples = dropped_;
    info.camera_samples = counters_.camera_samples;
    info.light_paths = counters_.light_paths;
    info.rays = counters_.rays;
    info.worker_count = uint32_t(workers_.size());
    info.image_digest = image_digest_;
    info.image_size_bytes = image_size_;
    info.duplicates_same = incidents.duplicates_same;
    info.duplicates_different = incidents.duplicates_different;
    info.tables = tables_;
    info.rare_light = rare_light_;
    info.noise = noise_;
    info.label = submission_.label;
    info.scene = submission_.scene;
    info.age_seconds = seconds_between(created_, now);
    tell_rendering(now, &info);
    if (prepared_ != TimePoint()) info.prepare_seconds = seconds_between(created_, prepared_);
    if (waits_for) {
        info.waits_for = waits_for->id;
        info.eta_seconds = waits_for->eta_seconds;
    }
    preparation_.tell(now, state_ == JobState::kPreparing, &info);
    return info;
}

double Job::seconds_left(TimePoint now) const {
    const double learned = state_ == JobState::kPreparing ? preparation_.seconds_taken(now) : preparation_.learning_seconds;
    return spec_.time_limit_seconds - learned - rendering_seconds(now);
}

bool Job::time_is_up(TimePoint now) const {
    return state_ == JobState::kRunning && spec_.time_limit_seconds > 0 && first_render_ && !closed_ && seconds_left(now) <= 0;
}

std::optional<TimePoint> Job::end_of_time() const {
    if (state_ != JobState::kRunning || spec_.time_limit_seconds <= 0 || !first_render_ || closed_) return std::nullopt;
    return seconds_after(*first_render_, spec_.time_limit_seconds - preparation_.learning_seconds - past_.rendering_seconds);
}

Effects Job::open_round(UnitKind kind, uint32_t number, const TrainingWork& work, std::optional<uint64_t> shuffle_seed) {
    Effects effects;
    if (preparation_.round) effects.throw_away(*std::move(preparation_.round));
    preparation_.round.emplace(kind, number, work, shuffle_seed);
    preparation_.round_begin = {};
    preparation_.phase = kind == UnitKind::kProbe ? PreparePhase::kProbing : PreparePhase::kTracing;
    effects.changed = effects.units = true;
    return effects;
}

Effects Job::wait_for_tables() {
    Effects effects;
    // The state is that before its own tracing, in case the job has to begin again.
    preparation_.training_begin = preparation_.work_begin = {};
    preparation_.learning_seconds = 0;
    if (preparation_.round) effects.throw_away(*std::move(preparation_.round));
    preparation_.round.reset();
    preparation_.phase = PreparePhase::kWaitingForTables;
    effects.changed = true;
    return effects;
}

Effects Job::begin_rendering(RenderPlan plan, TimePoint now) {
    Effects effects;
    if (state_ != JobState::kPreparing) {
        effects.throw_away(std::move(plan));
        return effects;
    }
    prepared_ = now;
    preparation_.stop_clock(now);
    spec_ = std::move(plan.spec);
    layers_ = std::move(plan.layers);
    units_ = std::move(plan.units);
    reducer_ = std::move(plan.reducer);
    tables_ = std::move(plan.tables);
    counters_ = plan.counters;
    dropped_ = plan.dropped;
    workers_ = std::move(plan.workers);
    if (finish_with_) units_->limit_groups(*finish_with_);
    effects += advance();
    effects.throw_away(std::exchange(preparation_.facts, {}));
    if (preparation_.round) effects.throw_away(*std::move(preparation_.round));
    preparation_.round.reset();
    preparation_.guide_bytes.reset();
    preparation_.guide = {};
    state_ = JobState::kRunning;
    const Rect& crop = spec_.frame.crop;
    effects.info(id() + ": " + std::to_string(crop.width()) + "x" + std::to_string(crop.height()) + ", " +
                 std::to_string(units_->tile_count()) + " tile(s), " + std::to_string(units_->unit_total()) + " unit(s)");
    effects.changed = effects.units = true;
    return effects;
}

UnitTable* Job::open_units() {
    if (state_ == JobState::kRunning) return &*units_;
    return state_ == JobState::kPreparing && preparation_.round ? &preparation_.round->units() : nullptr;
}

UnitTable* Job::open_units(const UnitKey& unit) {
    UnitTable* const table = open_units();
    if (!table) return nullptr;
    if (state_ == JobState::kRunning) return unit.kind == UnitKind::kRender ? table : nullptr;
    return unit == preparation_.round->key(unit.group) ? table : nullptr;
}

Effects Job::rendering_begins(TimePoint now) {
    Effects effects;
    if (first_render_) return effects;
    first_render_ = now;
    effects.changed = true;
    return effects;
}

Effects Job::count(const Work& work) {
    workers_.insert(work.worker);
    counters_ += work.counters;
    dropped_ += work.dropped;
    return advance();
}

Effects Job::advance() {
    Effects effects;
    const uint32_t groups = reducer_->folded_groups();
    if (groups > merged_groups_) {
        merged_groups_ = groups;
        merged_iterations_ = reducer_->iterations();
        units_->advance(groups);
        effects.units = true;  // groups open behind those that are complete
    }
    if (const auto noise = reducer_->noise()) {
        noise_ = noise;
        closed_ = closed_ || noise->reached;
    }
    effects.changed = true;
    return effects;
}

void Job::finish_with(uint32_t groups) {
    finish_with_ = groups;
    if (units_) units_->limit_groups(groups);
}

Effects Job::finish_if_complete(TimePoint now, bool* finish) {
    Effects effects;
    *finish = false;
    if (state_ != JobState::kRunning) return effects;
    if (finish_with_ && merged_groups_ >= *finish_with_) closed_ = true;
    if (closed_ && merged_groups_ == 0) units_->limit_groups(1);  // an image needs at least one group
    const bool all = units_->group_total() > 0 && merged_groups_ == units_->group_total();
    if (!all && !(closed_ && merged_groups_ > 0)) return effects;
    state_ = JobState::kFinishing;
    finishing_ = now;
    units_->close();
    *finish = effects.changed = true;
    return effects;
}

std::vector<UnitTable::Merged> Job::settle(const Image& image) {
    image_digest_ = image.digest;
    image_size_ = image.size;
    merged_groups_ = reducer_->folded_groups();
    merged_iterations_ = reducer_->iterations();
    // Results of groups that are not in the image do not count; what was summed just before freeze() does.
    units_->advance(merged_groups_);
    auto merged = units_->merged();
    for (const UnitTable::Merged& unit : merged) workers_.insert(unit.worker);
    counters_ = reducer_->counters();
    dropped_ = reducer_->dropped();
    rare_light_ = image.rare_light;
    noise_ = image.noise;
    return merged;
}

Effects Job::end(JobState state, std::string message, TimePoint now, OnCancel groups) {
    Effects effects;
    if (ended()) return effects;
    effects.keep = groups == OnCancel::kKeep && state != JobState::kSucceeded && reducer_ && merged_groups_ > 0;
    if (state != JobState::kSucceeded) image_digest_ = {}, image_size_ = 0;
    if (state_ == JobState::kPreparing || state_ == JobState::kRunning) finishing_ = now;
    state_ = state;
    message_ = std::move(message);
    ended_ = now;
    if (units_) {
        ended_units_ = {units_->unit_total(), units_->done_count()};
        units_->close();
    }
    effects.throw_away(std::exchange(preparation_.facts, {}));
    if (preparation_.round) effects.throw_away(*std::move(preparation_.round));
    preparation_.round.reset();
    preparation_.guide_bytes.reset();
    effects.throw_away(std::exchange(layers_, {}));
    if (!effects.keep) effects += throw_groups_away();
    effects.info(id() + ": " + std::string(to_string(state_)) + (message_.empty() ? "" : ": ") + message_);
    effects.changed = effects.ended = effects.units = true;
    return effects;
}

Effects Job::throw_groups_away() {
    Effects effects;
    if (units_) effects.throw_away(*std::move(units_));
    units_.reset();
    if (reducer_) effects.discard.push_back(std::move(reducer_));
    reducer_.reset();
    return effects;
}

Effects Job::let_go(bool written) {
    Effects effects = throw_groups_away();
    if (!written) image_digest_ = {}, image_size_ = 0;
    effects.changed = true;
    return effects;
}

bool Job::has_partial() const {
    if (state_ != JobState::kFailed && state_ != JobState::kCancelled) return false;
    return reducer_ || (last_ ? last_->image_size_bytes : image_size_) > 0;
}

bool Job::gave_all() const {
    if (state_ != JobState::kSucceeded) return false;
    const auto& noise = last_ ? last_->noise : noise_;
    const uint64_t iterations = last_ ? last_->samples_per_pixel_done : merged_iterations_;
    return (noise && noise->reached) || iterations == spec_.samples_per_pixel;
}

}  // namespace lightloom
