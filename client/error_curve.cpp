#include "client/error_curve.h"

#include <algorithm>
#include <cmath>

namespace lightloom::client {
namespace {

constexpr double kSpacing = 1.25;

/// a^(1 - t) b^t.
double geometric(double a, double b, double t) { return a * std::pow(b / a, t); }

}  // namespace

std::optional<Crossing> find_crossing(std::span<const CurvePoint> curve, double threshold) {
    if (curve.empty()) return std::nullopt;
    const auto below = std::find_if(curve.begin(), curve.end(), [&](const CurvePoint& p) { return p.error <= threshold; });
    if (below == curve.end()) {
        const CurvePoint& last = curve.back();
        const double factor = (last.error / threshold) * (last.error / threshold);
        return Crossing{Crossing::Kind::kExtrapolated, last.iterations * factor, last.seconds * factor};
    }
    if (below == curve.begin()) return Crossing{Crossing::Kind::kAtMost, below->iterations, below->seconds};
    const CurvePoint &a = below[-1], &b = *below;
    // An error of zero has no logarithm; the point itself is then the best that is known.
    if (!(b.error > 0)) return Crossing{Crossing::Kind::kInterpolated, b.iterations, b.seconds};
    const double t = std::log(a.error / threshold) / std::log(a.error / b.error);
    return Crossing{Crossing::Kind::kInterpolated, geometric(a.iterations, b.iterations, t), geometric(a.seconds, b.seconds, t)};
}

double next_checkpoint(double iterations) { return std::max(iterations + 1, std::ceil(iterations * kSpacing)); }

}  // namespace lightloom::client
