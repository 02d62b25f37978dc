#pragma once
// The one evaluator of the multiple importance sampling weight [Veach 1997, 9.2 and 10.2].
//
// Effective density of a technique with s light vertices:  rho = sigma C(s) A(s),
//     C(s) = prod_{i<s} pL[i],  A(s) = prod_{s<=i<k} pE[i],
// and of merging at x_i (the vertex is sampled from both sides):  rho = sigma C(i+1) A(i).
// sigma = n * (selection probability relative to plain tracing) is all that differs between algorithms. A selection says what it is
// for every technique by name, on one path:
//
//   struct Selection {
//       struct OnPath {                          // what a weight asks; PlainTechniques has the usual answers
//           static constexpr bool kMerges;
//           int s_min() const, s_max() const;    // splits outside are never asked about and need not be in the view
//           double survivors(int s) const;       // typical share of the sub-paths that roulette leaves (survival.h); 1: not known
//           double hit() const;                  // sigma / survivors(0)
//           double next_event() const;           // sigma / survivors(1), relative to C(1): pdf_next_event / pL[0] for one sample
//           double connect(int s) const;         // sigma / survivors(s), 1 <= s <= k - 1
//           double lens() const;                 // sigma / survivors(k)
//           double merge(int i) const;           // sigma, 1 <= i <= k - 1; only where kMerges
//       };
//       OnPath on(const PathView&) const;        // called once per weight: what costs O(k) belongs here
//   };
//
// Zero says that there is no such technique. Rules: the weights of all techniques sum to one over every path that some
// technique can produce; a weight depends only on the path and on tables frozen before the unit began. Some rules are
// handled here for all selections: connecting next to a Dirac vertex and merging at one is impossible, and a directly
// visible emitter (k = 1) is a hit alone.
//
// Range: densities of 1e12 per vertex and 64 vertices overflow even double, so the sweep walks outward from the
// technique that made the path with ratios, and keeps the exponent in a variable of its own.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/core/inline.h"
#include "common/core/math.h"
#include "common/path/path_view.h"
#include "common/path/technique.h"

namespace lightloom {

/// A non-negative number with its own exponent: value = mantissa * 2^(512 * shift). Infinity (two vertices in the same place)
/// stays what it is.
struct WideProduct {
    double mantissa = 1;
    int shift = 0;

    void multiply(double factor) {
        mantissa *= factor;
        while (mantissa > 0x1p256 && mantissa < HUGE_VAL) mantissa *= 0x1p-512, ++shift;
        while (mantissa < 0x1p-256 && mantissa > 0) mantissa *= 0x1p512, --shift;
    }
    /// The value as a double: infinity or zero beyond its range, which is what a sum of ratios needs.
    double value(double factor) const {
        double v = mantissa * factor;
        for (int i = 0; i < shift && v < HUGE_VAL && v > 0; ++i) v *= 0x1p512;
        for (int i = 0; i > shift && v > 0; --i) v *= 0x1p-512;
        return v;
    }
};

enum class Heuristic : uint8_t { kBalance, kPower, kMaximum };

/// The answers of most selections: every split exists, roulette is ignored, and there are hits and one next event, but
/// no other techniques.
struct PlainTechniques {
    static constexpr bool kMerges = false;
    const PathView& view;

    int s_min() const { return 0; }
    int s_max() const { return view.k; }
    double survivors(int) const { return 1; }
    double hit() const { return 1; }
    double next_event() const { return view.next_event / view.fwd[0]; }
    double connect(int) const { return 0; }
    double lens() const { return 0; }
    double merge(int) const { return 0; }
};

/// sigma of a technique that can make the path.
template <class OnPath>
double sigma(const OnPath& on, Technique t) {
    switch (t.kind) {
        case TechniqueKind::kHit: return on.survivors(0) * on.hit();
        case TechniqueKind::kNextEvent: return on.survivors(1) * on.next_event();
        case TechniqueKind::kConnect: return on.survivors(t.s) * on.connect(t.s);
        case TechniqueKind::kLens: return on.survivors(t.s) * on.lens();
        case TechniqueKind::kMerge: return on.merge(t.s);
    }
    return 0;
}

/// The place of a technique in the order in which ties are broken: hit, next event, connect 1, merge 1, connect 2, merge 2, ...,
/// lens.
constexpr int order_of(Technique t) {
    return t.kind == TechniqueKind::kHit         ? 0
           : t.kind == TechniqueKind::kNextEvent ? 1
                                                 : 2 * t.s + (t.kind == TechniqueKind::kMerge ? 1 : 0);
}

/// Calls visit(technique) for the techniques without merging that split the path after s light vertices, 0 <= s <= k, in the order
/// in which ties are broken.
template <class Visit>
void for_each_technique_of_split(int s, int k, Visit&& visit) {
    if (s == 0) return visit(Technique::hit());
    if (s == k) return visit(Technique::lens(k));
    if (s == 1) visit(Technique::next_event());
    visit(Technique::connect(s));
}

/// Whether no Dirac vertex stands next to the connection between x_{s-1} and x_s.
inline bool can_connect(const PathView& view, int s) {
    return !(s > 0 && view.delta[s - 1]) && !(s > 0 && s < view.k && view.delta[s]);
}

/// Calls visit(s, chain) with chain = C(s) A(s) / (C(base) A(base)) for every s != base from s_min to s_max for which
/// it is not zero, walking outward from `base`, a technique that can produce the path.
template <class Visit>
LL_ALWAYS_INLINE inline void for_each_split(const PathView& view, int base, int s_min, int s_max, Visit&& visit) {
    WideProduct chain;
    for (int s = base; s < s_max; ++s) {
        chain.multiply(view.fwd[s] / view.rev[s]);  // rev > 0: the own technique traced x_s from the camera
        if (chain.mantissa == 0) break;
        visit(s + 1, chain);
    }
    chain = WideProduct{};
    for (int s = base; s > s_min; --s) {
        chain.multiply(view.rev[s - 1] / view.fwd[s - 1]);  // fwd > 0: traced from the light (or next event, same support)
        if (chain.mantissa == 0) break;
        visit(s - 1, chain);
    }
}

namespace detail {

/// Calls add(sigma, chain, technique) for every technique but `own`: sigma * chain is its effective density over C(own.s) A(own.s),
/// and zero where it is impossible.
template <class OnPath, class Add>
LL_ALWAYS_INLINE inline void for_each_other(const PathView& view, Technique own, const OnPath& on, Add&& add) {
    const int k = view.k, base = own.s, s_min = on.s_min(), s_max = on.s_max();
    const auto split = [&](int s, const WideProduct& chain) LL_ALWAYS_INLINE {
        if (s < s_min || s > s_max || !can_connect(view, s)) return;
        const double survivors = on.survivors(s);
        if (s > 1 && s < k) [[likely]]
            return add(survivors * on.connect(s), chain, Technique::connect(s));
        if (s == 0) return add(survivors * on.hit(), chain, Technique::hit());
        if (s == k) return add(survivors * on.lens(), chain, Technique::lens(k));
        add(survivors * on.next_event(), chain, Technique::next_event());
        add(survivors * on.connect(s), chain, Technique::connect(s));
    };
    const auto merge = [&](int i, const WideProduct& chain) LL_ALWAYS_INLINE {
        if constexpr (OnPath::kMerges) {
            if (i < 1 || i > k - 1 || view.delta[i] || own == Technique::merge(i)) return;
            add(on.merge(i) * view.fwd[i], chain, Technique::merge(i));
        }
    };
    if (own.kind == TechniqueKind::kMerge) split(base, WideProduct{});
    if (own.kind == TechniqueKind::kConnect && base == 1)
        add(on.survivors(1) * on.next_event(), WideProduct{}, Technique::next_event());
    if (own.kind == TechniqueKind::kNextEvent) add(on.survivors(1) * on.connect(1), WideProduct{}, Technique::connect(1));
    merge(base, WideProduct{});
    for_each_split(view, base, OnPath::kMerges ? 0 : s_min, OnPath::kMerges ? k : s_max,
                   [&](int s, const WideProduct& chain) LL_ALWAYS_INLINE {
                       split(s, chain);
                       merge(s, chain);
                   });
}

/// Densities are compared by sixteenths of an octave, counted from the first technique in order_of() that can make the path, and
/// the earlier of equals wins. That is one order for all techniques, and rounding, which is different in each technique's view,
/// decides next to nothing: ratios of one, as those of merges at both ends of an edge between diffuse surfaces, lie in the middle
/// of their sixteenth.
class MaximumContest {
  public:
    void enter(double sigma, const WideProduct& chain, Technique t) {
        if (!(sigma > 0) || !(chain.mantissa > 0)) return;
        const double octaves = math::log(chain.mantissa * sigma) / 0.69314718055994530942 + 512.0 * chain.shift;
        entries_[count_++] = {std::clamp(octaves, -1e6, 1e6), order_of(t)};
    }
    /// Whether the technique that entered first has the largest density.
    bool first_wins() const {
        const Entry* reference =
            std::min_element(entries_, entries_ + count_, [](const Entry& a, const Entry& b) { return a.order < b.order; });
        const auto step = [&](const Entry& e) { return std::floor((e.octaves - reference->octaves) * 16 + 0.5); };
        const double mine = step(entries_[0]);
        return std::none_of(entries_ + 1, entries_ + count_, [&](const Entry& other) {
            const double theirs = step(other);
            return theirs > mine || (theirs == mine && other.order < entries_[0].order);
        });
    }

  private:
    struct Entry {
        double octaves;
        int order;
    };
    Entry entries_[2 * kMaxEdges + 2];
    int count_ = 0;
};

}  // namespace detail

/// The weight of technique `own` for the path in `on`'s view, in [0, 1]; zero when the selection has switched it off.
/// `own` must be able to produce the path.
template <class OnPath>
double mis_weight(const PathView& view, Technique own, const OnPath& on, Heuristic heuristic = Heuristic::kBalance) {
    if (view.k == 1) return own.kind == TechniqueKind::kHit && on.hit() > 0 ? 1 : 0;
    // sigma of the own technique, relative to C(base) A(base) of the split.
    double own_sigma = sigma(on, own);
    if constexpr (OnPath::kMerges) {
        if (own.kind == TechniqueKind::kMerge) own_sigma *= view.fwd[own.s];
    }
    if (!(own_sigma > 0)) return 0;
    if (heuristic == Heuristic::kMaximum) [[unlikely]] {
        detail::MaximumContest contest;
        contest.enter(own_sigma, WideProduct{}, own);
        detail::for_each_other(view, own, on, [&](double s, const WideProduct& chain, Technique t) { contest.enter(s, chain, t); });
        return contest.first_wins() ? 1 : 0;
    }
    const double inv_own = 1 / own_sigma;
    const bool squares = heuristic == Heuristic::kPower;
    double sum = 0;
    detail::for_each_other(view, own, on, [&](double other_sigma, const WideProduct& chain, Technique) LL_ALWAYS_INLINE {
        if (!(other_sigma > 0)) return;
        const double ratio = chain.value(other_sigma * inv_own);
        sum += squares ? ratio * ratio : ratio;
    });
    return 1 / (1 + sum);
}

}  // namespace lightloom
