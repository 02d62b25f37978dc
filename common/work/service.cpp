#include "common/work/service.h"

namespace lightloom {

bool is_terminal(JobState state) {
    return state == JobState::kSucceeded || state == JobState::kFailed || state == JobState::kCancelled;
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

}  // namespace lightloom
