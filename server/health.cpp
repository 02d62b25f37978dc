#include "server/health.h"

#include <condition_variable>
#include <mutex>

#include "common/cli/log_line.h"

namespace lightloom {
namespace {

constexpr auto kPulse = std::chrono::milliseconds(500);
constexpr auto kLook = std::chrono::seconds(1);

void sleep_or_stop(std::chrono::milliseconds time, const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any wake;
    std::unique_lock lock(mutex);
    wake.wait_for(lock, stop, time, [] { return false; });
}

std::string seconds_text(double seconds) { return std::to_string(int64_t(seconds)) + " s"; }

}  // namespace

Pulse::Pulse(Heartbeat& heart, std::function<void()> ask)
    : thread_([&heart, ask = std::move(ask)](std::stop_token stop) {
          while (!stop.stop_requested()) {
              ask();
              heart.beat();
              sleep_or_stop(kPulse, stop);
          }
      }) {}

HealthChecks make_health_checks(const Heartbeat& heart, std::filesystem::path directory, const HealthLimits& limits) {
    const auto live = [&heart, limits]() -> Status {
        const double silent = heart.silent_seconds();
        if (silent <= limits.silent_seconds) return {};
        return internal_error("the coordinator has stood still for " + seconds_text(silent) + "; restart it");
    };
    const auto ready = [live, directory = std::move(directory), limits]() -> Status {
        LL_RETURN_IF_ERROR(live());
        std::error_code error;
        const auto space = std::filesystem::space(directory, error);
        if (error) return internal_error(directory.string() + ": " + error.message());
        if (space.available >= limits.free_bytes) return {};
        return {StatusCode::kResourceExhausted, directory.string() + ": only " + std::to_string(space.available >> 20) +
                                                    " MiB of the disk are free, and " + std::to_string(limits.free_bytes >> 20) +
                                                    " are needed; make room"};
    };
    return {live, ready};
}

void follow_health(const std::function<Status()>& check, const std::function<void(bool healthy)>& set, std::stop_token stop) {
    bool was_healthy = true;
    set(true);
    while (!stop.stop_requested()) {
        const Status status = check ? check() : Status();
        if (status.ok() != was_healthy) {
            was_healthy = status.ok();
            set(was_healthy);
            if (was_healthy)
                log_info("healthy again");
            else
                log_error("not healthy: {}", status.message());
        }
        sleep_or_stop(kLook, stop);
    }
}

}  // namespace lightloom
