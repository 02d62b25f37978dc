#pragma once
// Where an error curve falls to a threshold.

#include <optional>
#include <span>

namespace lightloom::client {

/// A measured point of a run: an error (positive, in any unit) after so many iterations and seconds of rendering.
struct CurvePoint {
    double iterations = 0, seconds = 0, error = 0;
};

struct Crossing {
    enum class Kind {
        kInterpolated,  ///< Between two points, on a straight line in log-log coordinates.
        kAtMost,        ///< The first point lay at or below the threshold already.
        kExtrapolated,  ///< The last point lies above it: from there by the law error ~ n^-1/2, which a biased run never obeys.
    };
    Kind kind = Kind::kInterpolated;
    double iterations = 0, seconds = 0;
    /// kExtrapolated only: the curve does not fall as n^-1/2 yet, so that even more is needed. An estimator that misses the
    /// bright paths looks dark and almost right at first; its error rises before it falls.
    bool lower_bound = false;
};

/// Where points of ascending iterations fall to `threshold` (positive) for good: the crossing after the last point above it.
/// Nothing for an empty curve.
std::optional<Crossing> find_crossing(std::span<const CurvePoint> curve, double threshold);

/// Slope of log error over log iterations, by least squares over the last factor of four in iterations; -1/2 for a converging
/// unbiased run. Nothing for fewer than three points there.
std::optional<double> final_slope(std::span<const CurvePoint> curve);

/// Iterations from which on the next checkpoint is due: checkpoints are spaced by a factor of about 1.25.
double next_checkpoint(double iterations);

}  // namespace lightloom::client
