#include "server/preparation.h"

#include <algorithm>
#include <utility>

namespace lightloom {
namespace {

constexpr uint64_t kLearningSteps = 1000;  ///< Steps into which the progress of learning is divided.

/// Remaining time for `whole` when `done` of it took `seconds` of steady work; nothing while `done` is 0.
std::optional<double> remaining_seconds(double seconds, uint64_t done, uint64_t whole) {
    if (done == 0) return std::nullopt;
    return seconds * double(whole - done) / double(done);
}

}  // namespace

std::optional<double> Preparation::Learning::seconds_left(TimePoint now) const {
    if (!(share > 0)) return std::nullopt;
    return std::max(0.0, seconds_between(begin, heard) * (1 - share) / share - seconds_between(heard, now));
}

double Preparation::seconds_taken(TimePoint now) const {
    return learning_seconds + (work_begin != TimePoint() ? seconds_between(work_begin, now) : 0);
}

void Preparation::stop_clock(TimePoint now) {
    if (work_begin != TimePoint()) learning_seconds += seconds_between(std::exchange(work_begin, {}), now);
}

bool Preparation::waits() const {
    if (!round) return false;
    return round->complete() ? !scene_built : round->units().leased_count() == 0;
}

void Preparation::tell(TimePoint now, bool open, JobInfo* info) const {
    info->phase = phase;
    std::optional<double> left;
    if (phase == PreparePhase::kLearning && open) {
        info->phase_total = kLearningSteps;
        info->phase_done = uint64_t(double(kLearningSteps) * learning.share);
        left = learning.seconds_left(now);
    } else if (round) {
        info->unit_leased = round->units().leased_count();
        info->phase_total = round->work().total_samples;
        info->phase_done = round->samples_done();
        if (phase == PreparePhase::kTracing)
            left = remaining_seconds(seconds_between(training_begin, now), info->phase_done, info->phase_total);
    }
    if (left) info->eta_seconds = *left;
}

}  // namespace lightloom
