#pragma once
// Whether the coordinator works: its ticker turns, and its disk has room.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>

#include "common/core/result.h"

namespace lightloom {

/// When something that turns for ever last did so. One thread beats, any number look.
class Heartbeat {
  public:
    /// Allocates nothing and takes no lock.
    void beat() { last_.store(Clock::now(), std::memory_order_relaxed); }
    /// Seconds since the last beat, or since this object was made.
    double silent_seconds() const {
        return std::chrono::duration<double>(Clock::now() - last_.load(std::memory_order_relaxed)).count();
    }

  private:
    using Clock = std::chrono::steady_clock;
    std::atomic<Clock::time_point> last_{Clock::now()};
};

/// Beats whenever `ask` has returned, twice a second: for what answers, but does not beat by itself.
class Pulse {
  public:
    /// `heart` outlives the object. `ask` may block; the destructor waits for it.
    Pulse(Heartbeat& heart, std::function<void()> ask);

  private:
    std::jthread thread_;
};

/// What probes ask. Each returns OK, or one line that says what is wrong; it never blocks, and any thread may call it. Without a
/// function the answer is OK.
struct HealthChecks {
    std::function<Status()> live;   ///< The process works; one that does not should be restarted.
    std::function<Status()> ready;  ///< It also can take work.
};

struct HealthLimits {
    double silent_seconds = 5;                  ///< Of the heart, from which on the process counts as stuck.
    uint64_t free_bytes = uint64_t(128) << 20;  ///< Least room of the data directory.
};

/// Checks of a heart and of the disk of `directory`. `heart` outlives them.
HealthChecks make_health_checks(const Heartbeat& heart, std::filesystem::path directory, const HealthLimits& limits = {});

/// Calls `set(healthy)` at once, and then with every change of `check`, for which it looks once a second; until `stop`.
void follow_health(const std::function<Status()>& check, const std::function<void(bool healthy)>& set, std::stop_token stop);

}  // namespace lightloom
