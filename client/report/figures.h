#pragma once
// The figures of a report: what many runs say together. Everything here is a pure function of numbers.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/bench/error_curve.h"
#include "client/bench/numbers.h"

namespace lightloom::client::report {

/// Standard deviation of the median of as many values drawn from these with replacement (2000 draws that are the same every time);
/// nothing for fewer than two values.
std::optional<double> median_error(const std::vector<double>& values);

/// Points of ascending, positive x.
struct Curve {
    std::vector<double> x, y;
};

/// At `x`, which lies in the curve's range: a straight line between points in log-log coordinates. Both ends of its values that lie
/// outside are those of the ends.
double interpolate(const Curve& curve, double x);

/// What curves of several seeds have in common.
struct Band {
    std::vector<double> x, low, middle, high;  ///< Smallest, median and largest value.
};

/// Over the range of x that all curves cover, at points evenly spaced in log x; a single curve keeps its own points. Values are
/// positive. Where the curves have no range in common: one point, the medians of their last points.
Band seed_band(std::span<const Curve> curves, int points = 25);

/// A stretch of time over which one curve has the smallest error.
struct FrontPiece {
    size_t curve = 0;
    Curve line;  ///< Error against time, which never rises.
};

/// The Pareto front of time and error: the smallest error that any of the curves has reached at a time. Empty curves have no part.
std::vector<FrontPiece> pareto_front(std::span<const Curve> curves);

/// One run: error (as relMSE) against iterations and seconds of rendering, and what it spent before.
struct TimedRun {
    std::vector<CurvePoint> points;
    double preparation = 0;
};

struct SpeedUp {
    double factor = 1;                ///< Time of the base over time of the other, geometric means over the seeds.
    std::optional<double> log_error;  ///< Standard error of the factor's logarithm: a jackknife over the seeds.
    double degrees = 0;               ///< Degrees of freedom of that error.
    std::optional<double> low, high;  ///< 95 % interval by Student's t on the logarithm.
    bool at_least = false;            ///< A run lay at the error from its first point on.
    bool at_most = false;             ///< The same of the base; or a run's error does not fall as n^-1/2 yet.
    bool extrapolated = false;        ///< A run of the other has to be more than twice as long to reach the error.
};

/// "2.4×", with "≥" or "≤" before a bound and "~" before an extrapolation.
std::string to_text(const SpeedUp& speed_up);

/// How much sooner `other` reaches the relMSE `error`, preparation included, interpolated in log-log coordinates. Nothing where one
/// has no run.
std::optional<SpeedUp> speed_up(std::span<const TimedRun> base, std::span<const TimedRun> other, double error);

/// Geometric mean of factors; the interval says what the seeds leave open, not what other scenes would give.
std::optional<SpeedUp> geometric_mean(std::span<const SpeedUp> factors);

}  // namespace lightloom::client::report
