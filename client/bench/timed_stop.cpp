#include "client/bench/timed_stop.h"

#include <chrono>
#include <cmath>

namespace lightloom::client {

TimedStop::TimedStop(std::stop_token outer, double seconds) : outer_(std::move(outer)) {
    timer_ = std::jthread([this, seconds](std::stop_token finished) {
        // A stop of the outer token has to be passed on while we wait.
        const std::stop_callback pass_on(outer_, [this] { source_.request_stop(); });
        if (!std::isfinite(seconds)) {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, finished, [] { return false; });
            return;
        }
        std::unique_lock lock(mutex_);
        wake_.wait_for(lock, finished, std::chrono::duration<double>(seconds), [] { return false; });
        if (!finished.stop_requested()) source_.request_stop();
    });
}

}  // namespace lightloom::client
