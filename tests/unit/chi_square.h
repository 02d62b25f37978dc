#pragma once
// Pearson's chi-square goodness-of-fit test for samplers, with the p-value and Sidak's correction for many tests at once.

#include <cmath>
#include <vector>

namespace lightloom::testing {

/// Upper regularised incomplete gamma function Q(a, x): series below a + 1, continued fraction (Lentz) above.
inline double upper_gamma(double a, double x) {
    if (x <= 0) return 1;
    const double scale = std::exp(a * std::log(x) - x - std::lgamma(a));
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (int n = 1; n < 10000 && term > sum * 1e-16; ++n) sum += term *= x / (a + n);
        return 1 - scale * sum;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int n = 1; n < 10000; ++n) {
        const double an = -n * (n - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (std::fabs(d * c - 1) < 1e-15) break;
    }
    return scale * h;
}

struct ChiSquare {
    double statistic = 0;
    int degrees = 0;
    double p_value = 1;
};

/// `expected` holds counts that sum to the number of samples. Cells expecting fewer than five are pooled in order,
/// as the test's asymptotics ask.
inline ChiSquare chi_square_test(const std::vector<double>& observed, const std::vector<double>& expected) {
    ChiSquare r;
    double pooled_observed = 0, pooled_expected = 0;
    int cells = 0;
    const auto add = [&](double o, double e) {
        r.statistic += (o - e) * (o - e) / e;
        ++cells;
    };
    for (size_t i = 0; i < observed.size(); ++i) {
        if (expected[i] >= 5) {
            add(observed[i], expected[i]);
            continue;
        }
        pooled_observed += observed[i];
        pooled_expected += expected[i];
        if (pooled_expected >= 5) {
            add(pooled_observed, pooled_expected);
            pooled_observed = pooled_expected = 0;
        }
    }
    // What remains expects fewer than five: exact enough by the Poisson tail when it holds far more than that.
    if (pooled_observed > 30) r.p_value = 0;
    r.degrees = cells - 1;
    if (r.degrees > 0 && r.p_value > 0) r.p_value = upper_gamma(0.5 * r.degrees, 0.5 * r.statistic);
    return r;
}

/// The level of each of `count` independent tests whose family-wise level is `level`.
inline double sidak(double level, int count) { return -std::expm1(std::log1p(-level) / count); }

/// Two-sided p-value of a standard normal deviate.
inline double normal_p_value(double z) { return std::erfc(std::fabs(z) / std::sqrt(2.0)); }

}  // namespace lightloom::testing
