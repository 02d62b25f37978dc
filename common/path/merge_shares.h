#pragma once
// How many of the n light sub-paths of an iteration that may merge with a camera sub-path count in the weights.
// [common/path/README.md, "Merging"]

#include <algorithm>
#include <cmath>

#include "common/path/correction.h"
#include "common/path/correlation.h"

namespace lightloom {

/// n, the disc and the vertices at which merging is possible.
struct MergeRule {
    double paths = 1;  ///< n, at least 1.
    double disc = 0;   ///< Area of the disc, m^2.
    int last = 0;      ///< x_1 ... x_last may merge, Dirac vertices excepted.
};

/// The share c_i of the n light sub-paths that counts for merging at x_i; n c_i >= 1.
class MergeShares {
  public:
    /// Every share is 1.
    MergeShares() {}  // NOLINT: "= default" would have {} clear the array for every weight
    /// The correlation factor of correlation.h, for merges: both sub-paths end at x_i, so that the factors of all i are products of
    /// prefixes. The view must have what view_footprint() writes.
    static MergeShares correlation(const PathView& view, const MergeRule& rule);
    /// By the areas A_E and A_L over which the camera's and the light's sub-path would spread at x_i: with a = A_E / A_L,
    ///     c_i = (1 + a^2) / (1 + n a^2)                                             [Jendersie 2019, as its author's program has
    ///     it]
    /// A sub-path widens by w += 1 / sqrt(p_area) + (sum of the angles so far) d along each edge of length d. The view must have
    /// its edges.
    static MergeShares footprints(const PathView& view, const MergeRule& rule);
    /// c_i = 1 / k_i, k_i the photons that the disc at x_i holds on average, between 1 and n  [Jendersie and Grosch 2018, eq. 6];
    /// with `balanced` over the mean of all 1 / k_j of the path [eq. 7], and then n c_i may exceed n. The view must have its
    /// photons.
    static MergeShares photons(const PathView& view, const MergeRule& rule, bool balanced);

    /// 1 <= i <= rule.last.
    double operator()(int i) const { return all_ ? 1 : share_[i]; }

  private:
    bool all_ = true;
    double share_[kMaxEdges + 1];
};

inline MergeShares MergeShares::correlation(const PathView& view, const MergeRule& rule) {
    MergeShares out;
    out.all_ = false;
    const double area = kCorrelationDisc * view.primary_distance2;
    double product = 1;
    for (int i = view.k - 1; i >= 1; --i) {
        if (i + 1 == view.k || !view.delta[i + 1]) product *= std::min(area * view.rev[i], 1.0);
        out.share_[i] = product;
    }
    product = view.source == PathView::Source::kDiscrete    ? 1
              : view.source == PathView::Source::kDirection ? std::min(kCorrelationDisc * view.fwd[0], 1.0)
                                                            : std::min(area * view.fwd[0], 1.0);
    for (int i = 1; i < view.k; ++i) {
        if (!view.delta[i - 1]) product *= std::min(area * view.fwd[i], 1.0);
        const double camera = out.share_[i], either = camera + product * (1 - camera);
        out.share_[i] = either > 0 ? std::max(camera / either, 1 / rule.paths) : 1;
    }
    return out;
}

inline MergeShares MergeShares::footprints(const PathView& view, const MergeRule& rule) {
    MergeShares out;
    out.all_ = false;
    // Widths of the camera sub-path.
    double width = 0, angle = 0;
    const auto go_on = [&](double density, double distance, bool spreads) {
        if (spreads) angle += 1 / (std::sqrt(density) * distance);
        width += angle * distance;
    };
    for (int i = view.k - 1; i >= 1; --i) {
        go_on(view.rev[i], double(view.edge[i]), i + 1 == view.k || !view.delta[i + 1]);
        out.share_[i] = width;
    }
    const bool direction = view.source == PathView::Source::kDirection, area = view.source == PathView::Source::kArea;
    width = area ? 1 / std::sqrt(view.fwd[0]) : 0;
    angle = direction ? 1 / std::sqrt(view.fwd[0]) : 0;
    // Which of several lamps without extent it was spreads, too.
    const double choice = view.source == PathView::Source::kDiscrete ? 1 / view.fwd[0] : 1;
    for (int i = 1; i < view.k; ++i) {
        if (i == 1 && view.edge[0] == 0)
            width = 1 / std::sqrt(view.fwd[1]);  // a beam from outside the scene, whose length says nothing
        else
            go_on(view.fwd[i], double(view.edge[i - 1]), !view.delta[i - 1]);
        const double camera = out.share_[i] * out.share_[i], light = width * width * choice;
        const double ratio = camera / light, a2 = ratio * ratio;
        // Both may be 0 or infinite where nothing spreads, or where a density is 0: then nothing is known.
        out.share_[i] = a2 != a2 ? 1 : a2 < 1e150 ? (1 + a2) / (1 + rule.paths * a2) : 1 / rule.paths;
    }
    return out;
}

inline MergeShares MergeShares::photons(const PathView& view, const MergeRule& rule, bool balanced) {
    MergeShares out;
    out.all_ = false;
    double sum = 0;
    int count = 0;
    for (int i = 1; i <= rule.last; ++i) {
        out.share_[i] = 1 / std::clamp(rule.paths * rule.disc * double(view.photons[i]), 1.0, rule.paths);
        if (view.delta[i]) continue;
        sum += out.share_[i];
        ++count;
    }
    if (balanced && count > 0)
        for (int i = 1; i <= rule.last; ++i) out.share_[i] *= double(count) / sum;
    return out;
}

}  // namespace lightloom
