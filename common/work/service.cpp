#include "common/work/service.h"

#include <algorithm>
#include <cstdio>

#include "common/core/utf8.h"

namespace lightloom {

bool is_terminal(JobState state) {
    return state == JobState::kSucceeded || state == JobState::kFailed || state == JobState::kCancelled;
}

std::string TablesInfo::what() const {
    if (light_subspaces == 0) return "tables";
    return "tables of " + std::to_string(light_subspaces) + " x " + std::to_string(eye_subspaces) + " subspaces";
}

std::string_view to_string(JobState state) {
    switch (state) {
        case JobState::kPreparing: return "preparing";
        case JobState::kRunning: return "running";
        case JobState::kFinishing: return "finishing";
        case JobState::kSucceeded: return "succeeded";
        case JobState::kFailed: return "failed";
        case JobState::kCancelled: return "cancelled";
    }
    return "unknown";
}

std::string_view to_string(PreparePhase phase) {
    switch (phase) {
        case PreparePhase::kReadingScene: return "reading the scene";
        case PreparePhase::kProbing: return "measuring how fast training is";
        case PreparePhase::kTracing: return "tracing training paths";
        case PreparePhase::kLearning: return "learning the tables";
        case PreparePhase::kWaitingForTables: return "waiting for the tables of another job";
    }
    return "preparing";
}

std::string phase_text(const JobInfo& job) {
    const bool named = job.phase == PreparePhase::kWaitingForTables && !job.waits_for.empty();
    return named ? "waiting for the tables of " + job.waits_for : std::string(to_string(job.phase));
}

std::string_view to_string(WorkerState state) {
    switch (state) {
        case WorkerState::kBusy: return "busy";
        case WorkerState::kIdle: return "idle";
        case WorkerState::kResting: return "resting";
        case WorkerState::kGone: return "gone";
        case WorkerState::kRefused: return "refused";
    }
    return "unknown";
}

std::string unit_name(const UnitKey& key) {
    return key.kind == UnitKind::kRender ? std::to_string(key.group) + "/" + std::to_string(key.tile)
                                         : "of training " + std::to_string(key.round) + "/" + std::to_string(key.group);
}

Status check_label(const JobLabel& label) {
    for (const auto& [what, text] : {std::pair{"name", &label.name}, {"owner", &label.owner}}) {
        if (text->size() > JobLabel::kMaxBytes || !is_one_line(*text))
            return invalid_argument(std::string("the ") + what +
                                    " of a job is one line of UTF-8 without control characters, at most " +
                                    std::to_string(JobLabel::kMaxBytes) + " bytes long");
    }
    return {};
}

Status check_time_limit(double seconds) {
    if (seconds == 0 || (seconds >= kMinTimeLimit && seconds <= kMaxTimeLimit)) return {};
    char text[160];
    std::snprintf(text, sizeof text, "a time limit of %.3g s is not from 0.001 s to 30 days; give another, or a number of samples",
                  seconds);
    return invalid_argument(text);
}

std::optional<double> noise_share(const JobInfo& job) {
    if (!(job.spec.noise_target > 0) || !job.noise || job.noise->light_missing) return std::nullopt;
    const NoiseEstimate& noise = job.noise->estimate;
    const double done = double(job.samples_per_pixel_done);
    // The error falls as the reciprocal of the number of samples.
    return done / std::max(done, double(noise.iterations) * (noise.relmse + noise.error) / job.spec.noise_target);
}

double sample_share(const JobInfo& job) {
    const int64_t area = job.spec.frame.crop.area();
    const double iterations = job.spec.samples_per_pixel;
    if (area <= 0 || iterations == 0) return 0;
    const double paths = double(job.spec.algorithm.light_paths_per_iteration(area));
    // An algorithm without camera samples has light paths instead.
    const double done =
        job.camera_samples > 0 || paths == 0 ? double(job.camera_samples) / double(area) : double(job.light_paths) / paths;
    return std::min(1.0, done / iterations);
}

double rendered_share(const JobInfo& job) {
    if (job.state == JobState::kSucceeded || job.state == JobState::kFinishing) return 1;
    double done = sample_share(job);
    // Learning has taken a part of the limit before.
    if (job.spec.time_limit_seconds > 0 && job.render_seconds > 0 && job.eta_seconds >= 0)
        done = job.render_seconds / (job.render_seconds + job.eta_seconds);
    done = std::max(done, noise_share(job).value_or(0));
    return std::clamp(done, 0.0, 1.0);
}

}  // namespace lightloom
