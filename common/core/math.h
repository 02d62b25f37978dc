#pragma once
// Elementary functions whose bits do not depend on the host: glibc picks its implementation by CPU feature, so nothing
// that ends up in a picture (light transport, and the geometry that an importer makes) may call libm for anything but
// sqrt, floor and the like, which are single correctly rounded instructions. All are evaluated in double and are accurate
// to about 1e-14 relative, far below what float light needs.

#include <bit>
#include <cmath>
#include <cstdint>

namespace lightloom {

inline constexpr double kPiD = 3.14159265358979323846;
inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kTwoPi = 6.28318530717958647692f;
inline constexpr float kInvFourPi = 0.07957747154594766788f;

namespace math {

struct SinCos {
    double sin, cos;
};

/// Taylor polynomials on |r| <= pi/4; the truncation error is below 1e-15.
inline SinCos sincos_reduced(double r) {
    const double r2 = r * r;
    const double s =
        r * (1 + r2 * (-1.0 / 6 + r2 * (1.0 / 120 + r2 * (-1.0 / 5040 + r2 * (1.0 / 362880 + r2 * (-1.0 / 39916800 +
                                                                                                   r2 * (1.0 / 6227020800.0)))))));
    const double c =
        1 + r2 * (-0.5 + r2 * (1.0 / 24 +
                               r2 * (-1.0 / 720 + r2 * (1.0 / 40320 + r2 * (-1.0 / 3628800 + r2 * (1.0 / 479001600.0 -
                                                                                                   r2 * (1.0 / 87178291200.0)))))));
    return {s, c};
}

inline SinCos rotate_quadrant(SinCos v, int64_t quadrant) {
    switch (quadrant & 3) {
        case 0: return v;
        case 1: return {v.cos, -v.sin};
        case 2: return {-v.sin, -v.cos};
        default: return {-v.cos, v.sin};
    }
}

/// Sine and cosine of `x` radians, |x| < 1e6 or so (the reduction keeps two parts of pi/2).
inline SinCos sincos(double x) {
    const double q = std::floor(x * 0.63661977236758134308 + 0.5);
    const double r = (x - q * 1.57079632679489655800) - q * 6.12323399573676603587e-17;
    return rotate_quadrant(sincos_reduced(r), int64_t(q));
}

/// Sine and cosine of 2 pi u; azimuths, which are needed most often, use this form.
inline SinCos sincos_turns(double u) {
    const double q = std::floor(u * 4 + 0.5);
    return rotate_quadrant(sincos_reduced((u - q * 0.25) * 6.28318530717958647692), int64_t(q));
}

inline double sin(double x) { return sincos(x).sin; }
inline double cos(double x) { return sincos(x).cos; }
inline double tan(double x) {
    const SinCos v = sincos(x);
    return v.sin / v.cos;
}

/// e^x; overflows to infinity above 709.7 and flushes to zero below -708.
inline double exp(double x) {
    if (!(x < 709.7)) return x != x ? x : HUGE_VAL;
    if (x < -708) return 0;
    const double k = std::floor(x * 1.44269504088896340736 + 0.5);
    const double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    double sum = 1, term = 1;
    for (int i = 1; i <= 14; ++i) {
        term *= r / i;
        sum += term;
    }
    // 2^k in two factors, because k may reach 1024.
    const int64_t half = int64_t(k) / 2, rest = int64_t(k) - half;
    return sum * std::bit_cast<double>(uint64_t(half + 1023) << 52) * std::bit_cast<double>(uint64_t(rest + 1023) << 52);
}

/// Natural logarithm of x > 0; -infinity at 0, NaN below.
inline double log(double x) {
    if (!(x > 0)) return x == 0 ? -HUGE_VAL : std::bit_cast<double>(uint64_t(0x7ff8000000000000));
    if (x == HUGE_VAL) return x;
    int exponent = 0;
    if (x < 0x1p-1022) x *= 0x1p54, exponent = -54;
    const uint64_t bits = std::bit_cast<uint64_t>(x);
    exponent += int(bits >> 52) - 1022;
    double m = std::bit_cast<double>((bits & 0xfffffffffffffull) | 0x3fe0000000000000ull);  // in [0.5, 1)
    if (m < 0.70710678118654752440) m *= 2, exponent -= 1;
    const double s = (m - 1) / (m + 1), s2 = s * s;
    double sum = 0;
    for (int i = 23; i >= 1; i -= 2) sum = sum * s2 + 1.0 / i;
    return 2 * s * sum + exponent * 6.93147180369123816490e-01 + exponent * 1.90821492927058770002e-10;
}

/// x^y for x >= 0.
inline double pow(double x, double y) {
    if (y == 0) return 1;
    if (x == 0) return y > 0 ? 0 : HUGE_VAL;
    return exp(y * log(x));
}

inline double atan(double x) {
    const bool negative = x < 0;
    double a = negative ? -x : x;
    const bool reciprocal = a > 1;
    if (reciprocal) a = 1 / a;
    // Two half-angle steps bring the argument below tan(pi/16).
    a = a / (1 + std::sqrt(1 + a * a));
    a = a / (1 + std::sqrt(1 + a * a));
    const double a2 = a * a;
    double sum = 0;
    for (int i = 23; i >= 1; i -= 2) sum = 1.0 / i - sum * a2;
    double r = 4 * a * sum;
    if (reciprocal) r = 1.57079632679489661923 - r;
    return negative ? -r : r;
}

inline double atan2(double y, double x) {
    if (x == 0 && y == 0) return 0;
    if (x > 0) return atan(y / x);
    if (x < 0) return atan(y / x) + (y < 0 ? -kPiD : kPiD);
    return y > 0 ? kPiD / 2 : -kPiD / 2;
}

/// Arc cosine; the argument is clamped to [-1, 1].
inline double acos(double x) {
    if (x >= 1) return 0;
    if (x <= -1) return kPiD;
    return atan2(std::sqrt((1 - x) * (1 + x)), x);
}

}  // namespace math

template <typename T>
constexpr T clamp(T v, T lo, T hi) {
    return v < lo ? lo : (hi < v ? hi : v);
}
constexpr float lerp(float t, float a, float b) { return a + (b - a) * t; }
constexpr float sqr(float v) { return v * v; }
inline float safe_sqrt(float v) { return v > 0 ? std::sqrt(v) : 0.0f; }

}  // namespace lightloom
