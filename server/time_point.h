#pragma once
// The coordinator's time: a steady clock that its callers pass in, so that tests can set it.

#include <chrono>

namespace lightloom {

using TimePoint = std::chrono::steady_clock::time_point;

inline double seconds_between(TimePoint a, TimePoint b) { return std::chrono::duration<double>(b - a).count(); }

inline TimePoint seconds_after(TimePoint from, double seconds) {
    return from + std::chrono::duration_cast<TimePoint::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace lightloom
