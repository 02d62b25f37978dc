#pragma once
// How the weights take Russian roulette into account. The estimator divides by the true survival probability, which
// depends on the throughput of the walk that was taken. The weights use a function of the number of vertices that
// played roulette and lose light instead, so that they sum to one whatever roulette does. (Glass loses nothing: a walk
// that is caught in it for fifty events is as sure to go on as before.) Without this, a technique would be trusted as
// if its long sub-paths were never ended.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "common/core/inline.h"
#include "common/path/random_walk.h"

namespace lightloom {

/// A typical share, in (0, 1], of the sub-paths with n vertices that roulette leaves: kPerEvent, or rr-min
/// if that is more, for each time that it was played.
class TypicalSurvival {
  public:
    /// The usual survival probability after a surface of medium reflectance. Between 0.5 and 0.75 the noise of `lvcbpt`
    /// and `spcbpt` hardly differs; `bdpt` gains nothing and does without.
    static constexpr float kPerEvent = 0.6f;

    /// Without roulette every sub-path survives.
    TypicalSurvival() { shares_.fill(1); }
    explicit TypicalSurvival(const RouletteRule& rule) : first_vertex_(rule.first_vertex) {
        const double q = double(std::max(rule.min_survival, kPerEvent));
        double share = 1;
        for (size_t n = 0; n < shares_.size(); ++n) {
            if (int(n) > rule.first_vertex) share *= q;
            shares_[n] = share;
        }
    }
    /// 0 <= n <= kMaxEdges + 1.
    double operator()(int n) const { return shares_[size_t(n)]; }
    /// Roulette is played from this number of vertices on, after the last of them has scattered.
    int first_vertex() const { return first_vertex_; }

  private:
    std::array<double, kMaxEdges + 2> shares_;
    int first_vertex_ = kMaxEdges + 2;
};

/// The same for the sub-paths of a given path, whose lossless vertices do not count.
class PathSurvival {
  public:
    LL_ALWAYS_INLINE PathSurvival(const TypicalSurvival& typical, const PathView& view) : typical_(typical), k_(view.k) {
        bool any = false;
        for (int i = 1; i < k_; ++i) any |= view.lossless[i];
        if (any) [[unlikely]]
            mark(view);
    }
    /// The share of light sub-paths x_0 ... x_{s-1} that survive.
    double light(int s) const {
        const int first = typical_.first_vertex();
        return typical_(any_ && s > first ? s - lossless(first - 1, s - 1) : s);
    }
    /// The share of camera sub-paths x_k ... x_{k-t+1} that survive.
    double camera(int t) const {
        const int first = typical_.first_vertex();
        return typical_(any_ && t > first ? t - lossless(k_ - t + 2, k_ - first + 2) : t);
    }

  private:
    void mark(const PathView& view) {
        any_ = true;
        std::fill_n(words_, k_ / 64 + 1, 0);
        for (int i = 1; i < k_; ++i) words_[i / 64] |= uint64_t(view.lossless[i]) << (i % 64);
    }
    /// How many of x_begin ... x_{end-1} are lossless, 0 < begin <= end <= k.
    int lossless(int begin, int end) const {
        int count = 0;
        for (int w = begin / 64; w <= (end - 1) / 64; ++w) {
            uint64_t bits = words_[w];
            if (w == begin / 64) bits &= ~uint64_t(0) << (begin % 64);
            if (w == (end - 1) / 64) bits &= ~uint64_t(0) >> (63 - (end - 1) % 64);
            count += std::popcount(bits);
        }
        return count;
    }

    const TypicalSurvival& typical_;
    int k_;
    bool any_ = false;
    uint64_t words_[kMaxEdges / 64 + 1];
};

}  // namespace lightloom
