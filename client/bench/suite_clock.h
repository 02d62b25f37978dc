#pragma once
// The time of a suite over all processes that work on it, and what --budget leaves of it for a scene.

#include <chrono>
#include <limits>

#include "client/bench/suite.h"

namespace lightloom::client {

class SuiteClock {
  public:
    /// `spent`: seconds of earlier processes. `budget`: of all of them together; 0: none.
    SuiteClock(double spent, double budget) : spent_(spent), budget_(budget) {}

    double elapsed() const { return spent_ + std::chrono::duration<double>(Clock::now() - begin_).count(); }
    bool limited() const { return budget_ > 0; }
    /// Seconds that are left; infinite without a budget, never negative.
    double left() const;

  private:
    using Clock = std::chrono::steady_clock;
    double spent_, budget_;
    Clock::time_point begin_ = Clock::now();
};

/// Seconds that a run takes as it was asked for. One that is bounded by samples takes nobody knows how long; `typical` stands for
/// it.
double asked_seconds(const RunBudget& budget, double typical);

/// How a scene's runs fit into a share of the budget: runs may be shortened to half of what was asked for before seeds are left out
/// (not below three, and none of a judgement of stability); what is still too long is shortened further, to equal times for all.
uint32_t seeds_within(double share, uint32_t seeds, double seconds_of_one_seed, bool stability);

}  // namespace lightloom::client
