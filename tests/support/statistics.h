#pragma once
// The statistics by which tests decide: Pearson's chi-square for samplers, Student's and Welch's t for means, and
// Sidak's correction for many tests at once. Every decision is a p-value against a stated family-wise level; nothing is
// tuned.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/metrics/significance.h"

namespace lightloom::testing {

/// Upper regularised incomplete gamma function Q(a, x): series below a + 1, continued fraction
/// (Lentz) above.
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

/// `expected` holds counts that sum to the number of samples. Cells that expect fewer than five are pooled in order, as
/// the test's asymptotics require.
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
    // The remaining cells expect fewer than five together. If they hold far more, the Poisson tail shows clearly enough
    // that the hypothesis is false.
    if (pooled_observed > 30) r.p_value = 0;
    r.degrees = cells - 1;
    if (r.degrees > 0 && r.p_value > 0) r.p_value = upper_gamma(0.5 * r.degrees, 0.5 * r.statistic);
    return r;
}

using lightloom::normal_p_value;
using lightloom::sidak;
using lightloom::student_p_value;

/// Mean of independent replications (renders with different seeds) with an estimate of its error.
struct Sample {
    double mean = 0;
    double variance = 0;  ///< Variance of the mean, not of one replication.
    int count = 0;

    explicit Sample(const std::vector<double>& values) : count(int(values.size())) {
        for (const double v : values) mean += v / count;
        for (const double v : values) variance += (v - mean) * (v - mean) / (double(count) * (count - 1));
    }
    double standard_error() const { return std::sqrt(variance); }
    double relative_error() const { return mean != 0 ? standard_error() / std::fabs(mean) : (variance > 0 ? HUGE_VAL : 0); }
};

/// Renders carry float samples: means that differ by less than this fraction are equal whatever
/// their variance says.
inline constexpr double kFloatResolution = 2e-6;

/// Two-sided p-value of "the mean is `expected`".
inline double one_sample_p_value(const Sample& sample, double expected) {
    const double difference = std::fabs(sample.mean - expected);
    if (difference <= kFloatResolution * std::fabs(expected)) return 1;
    return sample.variance > 0 ? student_p_value(difference / sample.standard_error(), sample.count - 1) : 0;
}

/// Two-sided p-value of "both have the same mean", variances unknown and unequal [Welch 1947].
inline double welch_p_value(const Sample& a, const Sample& b) {
    const double difference = std::fabs(a.mean - b.mean), variance = a.variance + b.variance;
    if (difference <= kFloatResolution * std::max(std::fabs(a.mean), std::fabs(b.mean))) return 1;
    if (!(variance > 0)) return 0;
    const double degrees =
        variance * variance / (a.variance * a.variance / (a.count - 1) + b.variance * b.variance / (b.count - 1));
    return student_p_value(difference / std::sqrt(variance), degrees);
}

/// All tests that are decided together. check() fails for each p-value below Sidak's level, so that
/// the chance of a false alarm anywhere in the family is `level`.
class TestFamily {
  public:
    void add(double p_value, std::string what) { tests_.push_back({p_value, std::move(what)}); }
    int size() const { return int(tests_.size()); }
    void check(double level = 0.01) const {
        ASSERT_FALSE(tests_.empty());
        const double each = sidak(level, size());
        for (const Entry& test : tests_)
            EXPECT_GE(test.p_value, each) << test.what << ": p = " << test.p_value << ", Sidak level " << each << " for " << size()
                                          << " tests";
    }

  private:
    struct Entry {
        double p_value;
        std::string what;
    };
    std::vector<Entry> tests_;
};

}  // namespace lightloom::testing
