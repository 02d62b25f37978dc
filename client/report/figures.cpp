#include "client/report/figures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "common/core/rng.h"
#include "common/metrics/significance.h"

namespace lightloom::client::report {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kOutside = 0.05;  ///< Probability that an interval misses.

double geometric(double a, double b, double t) { return a * std::pow(b / a, t); }

/// Mean of logarithms of times, and its variance as a jackknife over the runs gives it.
struct LogTime {
    double mean = 0;
    double variance = kNaN;  ///< Not known of a single run.
    int count = 0;
};

LogTime log_time(const std::vector<double>& times) {
    LogTime out{0, kNaN, int(times.size())};
    for (const double time : times) out.mean += std::log(time) / out.count;
    if (out.count < 2) return out;
    double sum = 0;
    for (const double time : times) sum += (std::log(time) - out.mean) * (std::log(time) - out.mean);
    out.variance = sum / (out.count - 1) / out.count;
    return out;
}

/// Times at which runs reach an error.
struct Reached {
    std::vector<double> times;
    bool at_most = false, lower_bound = false, far = false;
};

Reached reach(std::span<const TimedRun> runs, double error) {
    Reached out;
    for (const TimedRun& run : runs) {
        std::vector<CurvePoint> roots = run.points;  // find_crossing() knows errors that fall as n^-1/2.
        for (CurvePoint& point : roots) point.error = std::sqrt(point.error);
        const auto crossing = find_crossing(roots, std::sqrt(error));
        if (!crossing) continue;
        out.times.push_back(crossing->seconds + run.preparation);
        out.at_most |= crossing->kind == Crossing::Kind::kAtMost;
        out.lower_bound |= crossing->kind == Crossing::Kind::kExtrapolated && crossing->lower_bound;
        out.far |= crossing->iterations > 2 * roots.back().iterations;
    }
    return out;
}

void set_interval(SpeedUp* out) {
    const double reach = *out->log_error * student_quantile(kOutside, out->degrees);
    out->low = out->factor * std::exp(-reach);
    out->high = out->factor * std::exp(reach);
}

}  // namespace

std::optional<double> median_error(const std::vector<double>& values) {
    if (values.size() < 2) return std::nullopt;
    constexpr int kDraws = 2000;
    Rng rng(RngKey{});
    std::vector<double> drawn(values.size());
    double mean = 0, moment = 0;
    for (int i = 1; i <= kDraws; ++i) {
        for (double& value : drawn) value = values[size_t(rng.uniform_double() * double(values.size()))];
        const double middle = median(drawn), change = middle - mean;
        mean += change / i;
        moment += change * (middle - mean);
    }
    return std::sqrt(moment / (kDraws - 1));
}

double interpolate(const Curve& curve, double x) {
    const auto after = std::lower_bound(curve.x.begin(), curve.x.end(), x);
    if (after == curve.x.begin()) return curve.y.front();
    if (after == curve.x.end()) return curve.y.back();
    const size_t i = size_t(after - curve.x.begin());
    const double t = std::log(x / curve.x[i - 1]) / std::log(curve.x[i] / curve.x[i - 1]);
    return geometric(curve.y[i - 1], curve.y[i], t);
}

Band seed_band(std::span<const Curve> curves, int points) {
    std::vector<const Curve*> filled;
    for (const Curve& curve : curves)
        if (!curve.x.empty()) filled.push_back(&curve);
    if (filled.empty()) return {};
    if (filled.size() == 1) return {filled[0]->x, filled[0]->y, filled[0]->y, filled[0]->y};
    double from = 0, to = std::numeric_limits<double>::infinity();
    for (const Curve* curve : filled) from = std::max(from, curve->x.front()), to = std::min(to, curve->x.back());
    Band band;
    const auto add = [&](double x, std::vector<double> values) {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        band.x.push_back(x), band.low.push_back(*low), band.high.push_back(*high);
        band.middle.push_back(median(std::move(values)));
    };
    if (!(from < to)) {
        std::vector<double> xs, ys;
        for (const Curve* curve : filled) xs.push_back(curve->x.back()), ys.push_back(curve->y.back());
        add(median(std::move(xs)), std::move(ys));
        return band;
    }
    for (int i = 0; i < points; ++i) {
        const double x = geometric(from, to, double(i) / (points - 1));
        std::vector<double> values;
        for (const Curve* curve : filled) values.push_back(interpolate(*curve, x));
        add(x, std::move(values));
    }
    return band;
}

std::vector<FrontPiece> pareto_front(std::span<const Curve> curves) {
    constexpr int kSteps = 400;
    double from = std::numeric_limits<double>::infinity(), to = 0;
    for (const Curve& curve : curves) {
        if (curve.x.empty()) continue;
        from = std::min(from, curve.x.front());
        to = std::max(to, curve.x.back());
    }
    std::vector<FrontPiece> pieces;
    double best = std::numeric_limits<double>::infinity();
    size_t holder = curves.size();
    for (int i = 0; i <= kSteps && from <= to; ++i) {
        const double time = i == kSteps ? to : geometric(from, to, double(i) / kSteps);
        for (size_t k = 0; k < curves.size(); ++k) {
            // What a curve's end has reached, it has reached for later times too.
            if (curves[k].x.empty() || curves[k].x.front() > time * (1 + 1e-12)) continue;
            const double error = interpolate(curves[k], time);
            if (error < best) best = error, holder = k;
        }
        if (pieces.empty() || pieces.back().curve != holder) {
            if (!pieces.empty()) {  // The front goes straight down, or on, to the next piece.
                pieces.back().line.x.push_back(time);
                pieces.back().line.y.push_back(pieces.back().line.y.back());
            }
            pieces.push_back({holder, {}});
        }
        pieces.back().line.x.push_back(time);
        pieces.back().line.y.push_back(best);
    }
    return pieces;
}

std::string to_text(const SpeedUp& speed_up) {
    char text[32];
    const double factor = speed_up.factor;
    std::snprintf(text, sizeof text,
                  factor >= 99.5     ? "%.0f×"
                  : factor >= 9.95   ? "%.3g×"
                  : factor >= 0.0995 ? "%.2g×"
                                     : "%.1g×",
                  factor);
    std::string out = speed_up.extrapolated ? "~" : "";
    if (speed_up.at_least && !speed_up.at_most) out += "≥";
    if (speed_up.at_most && !speed_up.at_least) out += "≤";
    if (speed_up.at_least && speed_up.at_most) out += "?";
    return out + text;
}

std::optional<SpeedUp> speed_up(std::span<const TimedRun> base, std::span<const TimedRun> other, double error) {
    const Reached a = reach(base, error), b = reach(other, error);
    if (a.times.empty() || b.times.empty()) return std::nullopt;
    const LogTime base_time = log_time(a.times), other_time = log_time(b.times);
    SpeedUp out;
    out.factor = std::exp(base_time.mean - other_time.mean);
    out.at_least = b.at_most || a.lower_bound;
    out.at_most = a.at_most || b.lower_bound;
    out.extrapolated = a.far || b.far;
    const double variance = base_time.variance + other_time.variance;
    if (std::isnan(variance)) return out;
    out.log_error = std::sqrt(variance);
    if (!(variance > 0)) {
        out.low = out.high = out.factor;
        return out;
    }
    const auto square_over = [](const LogTime& time) { return time.variance * time.variance / (time.count - 1); };
    out.degrees = variance * variance / (square_over(base_time) + square_over(other_time));  // Welch and Satterthwaite
    set_interval(&out);
    return out;
}

std::optional<SpeedUp> geometric_mean(std::span<const SpeedUp> factors) {
    if (factors.empty()) return std::nullopt;
    SpeedUp out;
    double sum = 0, variance = 0, squares = 0;
    bool known = true;
    for (const SpeedUp& factor : factors) {
        sum += std::log(factor.factor);
        known &= factor.log_error.has_value();
        const double own = factor.log_error.value_or(0) * factor.log_error.value_or(0);
        variance += own;
        if (own > 0) squares += own * own / factor.degrees;
        out.at_least |= factor.at_least, out.at_most |= factor.at_most, out.extrapolated |= factor.extrapolated;
    }
    const double count = double(factors.size());
    out.factor = std::exp(sum / count);
    if (!known) return out;
    out.log_error = std::sqrt(variance) / count;
    out.degrees = squares > 0 ? variance * variance / squares : std::numeric_limits<double>::infinity();
    set_interval(&out);
    return out;
}

}  // namespace lightloom::client::report
