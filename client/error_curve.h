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
        kExtrapolated,  ///< No point reached it: from the last one by the law error ~ n^-1/2, which a biased run never obeys.
    };
    Kind kind = Kind::kInterpolated;
    double iterations = 0, seconds = 0;
};

/// The first crossing of `threshold` (positive) by points of ascending iterations. Nothing for an empty curve.
std::optional<Crossing> find_crossing(std::span<const CurvePoint> curve, double threshold);

/// Iterations from which on the next checkpoint is due: checkpoints are spaced by a factor of about 1.25.
double next_checkpoint(double iterations);

}  // namespace lightloom::client
