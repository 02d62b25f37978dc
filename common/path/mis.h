#pragma once
// The one evaluator of the multiple importance sampling weight [Veach 1997, 9.2 and 10.2].
//
// Effective density of connecting with s light vertices:  rho_s = sigma(s) C(s) A(s),
//     C(s) = prod_{i<s} pL[i],  A(s) = prod_{s<=i<k} pE[i],
// and of merging at x_i (the vertex is sampled from both sides):  rho = sigma_merge(i) C(i+1) A(i).
// sigma = n * (selection probability relative to plain tracing) is all that differs between algorithms:
//
//   struct Selection {
//       int s_min(int k) const, s_max(int k) const;          // techniques outside do not exist (inclusive, within 0..k)
//       double connect_factor(const PathView&, int s) const; // sigma(s); 0 where the technique cannot produce the path
//       double merge_factor(const PathView&, int i) const;   // only when kMerges is true
//       static constexpr bool kMerges;
//   };
//
// Rules: the weights of all techniques sum to one over every path that some technique can produce; a weight depends only
// on the path and on tables frozen before the unit began. Dirac vertices are handled here: a connection next to one is
// impossible.
//
// Range: densities of 1e12 per vertex and 64 vertices overflow even double, so the sweep walks outward from the technique
// that made the path with ratios, and keeps the exponent apart.

#include <cmath>
#include <cstdint>

#include "common/path/path_view.h"

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

namespace detail {

/// Collects ratios rho_other / rho_own under one heuristic.
struct RatioSum {
    Heuristic heuristic;
    double sum = 0;
    bool beaten = false;

    /// `earlier` breaks ties of the maximum heuristic: the technique that comes first in the sweep order wins.
    void add(double ratio, bool earlier) {
        switch (heuristic) {
            case Heuristic::kBalance: sum += ratio; break;
            case Heuristic::kPower: sum += ratio * ratio; break;
            case Heuristic::kMaximum: beaten |= earlier ? ratio >= 1 : ratio > 1; break;
        }
    }
    double weight() const { return heuristic == Heuristic::kMaximum ? (beaten ? 0.0 : 1.0) : 1 / (1 + sum); }
};

}  // namespace detail

/// Whether no Dirac vertex stands next to the connection between x_{s-1} and x_s.
inline bool can_connect(const PathView& view, int s) {
    return !(s > 0 && view.delta[s - 1]) && !(s > 0 && s < view.k && view.delta[s]);
}

/// Calls visit(s, chain) with chain = C(s) A(s) / (C(base) A(base)) for every s != base from s_min to s_max that it is not
/// zero for, walking outward from `base`, a technique that can produce the path.
template <class Visit>
void for_each_split(const PathView& view, int base, int s_min, int s_max, Visit&& visit) {
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

/// w of technique `own` for the path in `view`, in [0, 1]; zero when the selection has switched it off. `own` must be able to
/// produce the path.
template <class Selection>
double mis_weight(const PathView& view, Technique own, const Selection& selection, Heuristic heuristic = Heuristic::kBalance) {
    const int k = view.k, s_min = selection.s_min(k), s_max = selection.s_max(k);
    const auto connect = [&](int s) -> double {
        return s < s_min || s > s_max || !can_connect(view, s) ? 0 : selection.connect_factor(view, s);
    };
    // sigma of the own technique, relative to C(base) A(base) of the connection with the same split.
    const int base = own.s;
    double own_factor = 0;
    if (own.kind == TechniqueKind::kConnect) own_factor = selection.connect_factor(view, base);
    if constexpr (Selection::kMerges) {
        if (own.kind == TechniqueKind::kMerge) own_factor = selection.merge_factor(view, base) * view.fwd[base];
    }
    if (!(own_factor > 0)) return 0;
    const double inv_own = 1 / own_factor;
    detail::RatioSum ratios{heuristic};
    const auto merge = [&](int i, const WideProduct& chain, bool earlier) {
        if constexpr (Selection::kMerges) {
            if (i < 1 || i > k - 1 || view.delta[i] || (own.kind == TechniqueKind::kMerge && i == base)) return;
            const double factor = selection.merge_factor(view, i);
            if (factor > 0) {
                WideProduct merged = chain;
                merged.multiply(view.fwd[i]);
                ratios.add(merged.value(factor * inv_own), earlier);
            }
        }
    };

    // Order for ties: connect 0, connect 1, merge 1, connect 2, merge 2, ...
    if (own.kind == TechniqueKind::kMerge)
        if (const double f = connect(base); f > 0) ratios.add(f * inv_own, true);
    merge(base, WideProduct{}, false);
    for_each_split(view, base, Selection::kMerges ? 0 : s_min, Selection::kMerges ? k : s_max,
                   [&](int s, const WideProduct& chain) {
                       if (const double f = connect(s); f > 0) ratios.add(chain.value(f * inv_own), s < base);
                       merge(s, chain, s < base);
                   });
    return ratios.weight();
}

}  // namespace lightloom
