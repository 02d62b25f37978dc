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

}  // namespace lightloom
