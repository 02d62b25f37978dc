#pragma once
// How the weights reckon with Russian roulette. The estimator divides by the true survival probability, which depends on the
// throughput of the walk that was taken; the weights take a function of the number of vertices alone, the same for every path, so
// that they sum to one whatever roulette does. Without it, a technique is trusted as if its long sub-paths were never ended.

#include <algorithm>
#include <array>

#include "common/path/random_walk.h"

namespace lightloom {

/// A typical share, in (0, 1], of the sub-paths with n vertices that roulette leaves: kPerEvent, or rr-min
/// if that is more, for each time that it was played.
class TypicalSurvival {
  public:
    /// What survives a surface of middling reflectance, once the throughput stays near the survival that it is divided by. Between
    /// 0.5 and 0.75 the noise of `lvcbpt` and `spcbpt` hardly differs; `bdpt` gains nothing and does without.
    static constexpr float kPerEvent = 0.6f;

    /// Without roulette.
    TypicalSurvival() { shares_.fill(1); }
    explicit TypicalSurvival(const RouletteRule& rule) {
        const double q = double(std::max(rule.min_survival, kPerEvent));
        double share = 1;
        for (size_t n = 0; n < shares_.size(); ++n) {
            if (int(n) > rule.first_vertex) share *= q;
            shares_[n] = share;
        }
    }
    /// 0 <= n <= kMaxEdges + 1.
    double operator()(int n) const { return shares_[size_t(n)]; }

  private:
    std::array<double, kMaxEdges + 2> shares_;
};

}  // namespace lightloom
