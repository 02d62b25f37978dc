#pragma once
// Wall-clock time of one phase after the other.

#include <chrono>
#include <utility>

namespace lightloom {

class Stopwatch {
  public:
    /// Seconds since the last lap, or since the watch was made.
    double lap() {
        const auto now = std::chrono::steady_clock::now();
        return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
    }

  private:
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace lightloom
