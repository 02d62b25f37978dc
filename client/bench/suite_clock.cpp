#include "client/bench/suite_clock.h"

#include <algorithm>

namespace lightloom::client {

double SuiteClock::left() const { return limited() ? std::max(0.0, budget_ - elapsed()) : std::numeric_limits<double>::infinity(); }

double asked_seconds(const RunBudget& budget, double typical) { return budget.seconds > 0 ? budget.seconds : typical; }

uint32_t seeds_within(double share, uint32_t seeds, double seconds_of_one_seed, bool stability) {
    constexpr uint32_t kFewest = 3;
    if (stability || seeds <= kFewest || !(seconds_of_one_seed > 0)) return seeds;
    const double fitting = share / (0.5 * seconds_of_one_seed);
    if (fitting >= seeds) return seeds;
    return std::max(kFewest, uint32_t(std::max(0.0, fitting)));
}

}  // namespace lightloom::client
