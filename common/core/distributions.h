#pragma once
// Student's t and the normal distribution, and Sidak's correction: what tests and cross-checks decide by. They use libm, so
// nothing that ends up in a picture may use them.

#include <cmath>

namespace lightloom {

/// The level of each of `count` independent tests whose family-wise level is `level`, in (0, 1).
inline double sidak(double level, int count) { return -std::expm1(std::log1p(-level) / count); }

/// Two-sided p-value of a standard normal deviate.
inline double normal_p_value(double z) { return std::erfc(std::fabs(z) / std::sqrt(2.0)); }

/// Regularised incomplete beta function I_x(a, b) by its continued fraction (modified Lentz).
inline double incomplete_beta(double a, double b, double x) {
    if (x <= 0) return 0;
    if (x >= 1) return 1;
    if (x > (a + 1) / (a + b + 2)) return 1 - incomplete_beta(b, a, 1 - x);
    const double scale = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x)) / a;
    double c = 1, d = 1 / (1 - (a + b) * x / (a + 1)), h = d;
    for (int m = 1; m < 10000; ++m) {
        const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        d = 1 / (1 + even * d);
        c = 1 + even / c;
        h *= c * d;
        const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        d = 1 / (1 + odd * d);
        c = 1 + odd / c;
        h *= c * d;
        if (std::fabs(c * d - 1) < 1e-15) break;
    }
    return scale * h;
}

/// Two-sided p-value of Student's t with `degrees` of freedom, which may be infinite (the normal distribution).
inline double student_p_value(double t, double degrees) {
    if (!(degrees < 1e8)) return normal_p_value(t);
    return incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
}

/// The deviate whose two-sided p-value is `p`, in (0, 1), by bisection.
inline double student_quantile(double p, double degrees) {
    double low = 0, high = 1;
    while (student_p_value(high, degrees) > p && high < 1e12) high *= 2;
    for (int i = 0; i < 100; ++i) {
        const double middle = (low + high) / 2;
        (student_p_value(middle, degrees) > p ? low : high) = middle;
    }
    return (low + high) / 2;
}

}  // namespace lightloom
