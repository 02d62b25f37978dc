#include "client/bench/error_curve.h"

#include <algorithm>
#include <cmath>

namespace lightloom::client {
namespace {

constexpr double kSpacing = 1.25;
/// Slopes above this one are not taken for n^-1/2; between the two lies what noise in a curve makes of it.
constexpr double kConvergingSlope = -0.4;

/// a^(1 - t) b^t.
double geometric(double a, double b, double t) { return a * std::pow(b / a, t); }

}  // namespace

std::optional<Crossing> find_crossing(std::span<const CurvePoint> curve, double threshold) {
    if (curve.empty()) return std::nullopt;
    size_t below = curve.size();  // The first point of those at the end that all lie at or below the threshold.
    while (below > 0 && curve[below - 1].error <= threshold) --below;
    if (below == curve.size()) {
        const CurvePoint& last = curve.back();
        const double factor = (last.error / threshold) * (last.error / threshold);
        const auto slope = final_slope(curve);
        return Crossing{Crossing::Kind::kExtrapolated, last.iterations * factor, last.seconds * factor,
                        !slope || *slope > kConvergingSlope};
    }
    if (below == 0) return Crossing{Crossing::Kind::kAtMost, curve[0].iterations, curve[0].seconds};
    const CurvePoint &a = curve[below - 1], &b = curve[below];
    // An error of zero has no logarithm; the point itself is then the best that is known.
    if (!(b.error > 0)) return Crossing{Crossing::Kind::kInterpolated, b.iterations, b.seconds};
    const double t = std::log(a.error / threshold) / std::log(a.error / b.error);
    return Crossing{Crossing::Kind::kInterpolated, geometric(a.iterations, b.iterations, t), geometric(a.seconds, b.seconds, t)};
}

std::optional<double> final_slope(std::span<const CurvePoint> curve) {
    double count = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (const CurvePoint& point : curve) {
        if (point.iterations * 4 < curve.back().iterations || !(point.error > 0)) continue;
        const double x = std::log(point.iterations), y = std::log(point.error);
        count += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    if (count < 3) return std::nullopt;
    return (count * sxy - sx * sy) / (count * sxx - sx * sx);
}

double next_checkpoint(double iterations) { return std::max(iterations + 1, std::ceil(iterations * kSpacing)); }

}  // namespace lightloom::client
