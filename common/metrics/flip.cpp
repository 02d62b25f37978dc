#include "common/metrics/flip.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>

#include "common/core/math.h"
#include "common/core/vec.h"
#include "common/metrics/convolution.h"

namespace lightloom {

namespace {

struct Triple {
    double x, y, z;
};

struct Matrix {
    double m[3][3];
};

constexpr Matrix invert(const double (&a)[3][3]) {
    Matrix r{};
    double determinant = 0;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const int r0 = (j + 1) % 3, r1 = (j + 2) % 3, c0 = (i + 1) % 3, c1 = (i + 2) % 3;
            r.m[i][j] = a[r0][c0] * a[r1][c1] - a[r0][c1] * a[r1][c0];
        }
        determinant += a[0][i] * r.m[i][0];
    }
    for (auto& row : r.m) {
        for (double& v : row) v /= determinant;
    }
    return r;
}

/// Linear sRGB to XYZ, from the primaries of IEC 61966-2-1. White is D65 with five digits, (0.31271, 0.32902), because the
/// matrix in the authors' code is that one to the last digit.
constexpr Matrix rgb_to_xyz() {
    constexpr double kRed[2] = {0.64, 0.33}, kGreen[2] = {0.30, 0.60}, kBlue[2] = {0.15, 0.06}, kD65[2] = {0.31271, 0.32902};
    constexpr double kPrimaries[3][3] = {
        {kRed[0], kGreen[0], kBlue[0]},
        {kRed[1], kGreen[1], kBlue[1]},
        {1 - kRed[0] - kRed[1], 1 - kGreen[0] - kGreen[1], 1 - kBlue[0] - kBlue[1]},
    };
    constexpr double kWhiteXyz[3] = {kD65[0] / kD65[1], 1, (1 - kD65[0] - kD65[1]) / kD65[1]};
    const Matrix inverse = invert(kPrimaries);
    Matrix result{};
    for (int c = 0; c < 3; ++c) {
        double strength = 0;
        for (int k = 0; k < 3; ++k) strength += inverse.m[c][k] * kWhiteXyz[k];
        for (int r = 0; r < 3; ++r) result.m[r][c] = kPrimaries[r][c] * strength;
    }
    return result;
}
constexpr Matrix kToXyz = rgb_to_xyz();
constexpr Matrix kFromXyz = invert(kToXyz.m);
// The illuminant is the XYZ of RGB white, so that greys have no chroma to the last digit.
constexpr Triple kWhite{kToXyz.m[0][0] + kToXyz.m[0][1] + kToXyz.m[0][2], kToXyz.m[1][0] + kToXyz.m[1][1] + kToXyz.m[1][2],
                        kToXyz.m[2][0] + kToXyz.m[2][1] + kToXyz.m[2][2]};

inline Triple multiply(const double (&a)[3][3], Triple v) {
    return {a[0][0] * v.x + a[0][1] * v.y + a[0][2] * v.z, a[1][0] * v.x + a[1][1] * v.y + a[1][2] * v.z,
            a[2][0] * v.x + a[2][1] * v.y + a[2][2] * v.z};
}

/// Cube root of v > 0 by Halley's iteration from a guess made of the exponent.
inline double cube_root(double v) {
    double y = std::bit_cast<double>(std::bit_cast<uint64_t>(v) / 3 + 0x2a9f789300000000ull);
    for (int i = 0; i < 3; ++i) {
        const double y3 = y * y * y;
        y *= (y3 + 2 * v) / (2 * y3 + v);
    }
    return y;
}

/// Opponent space of the contrast sensitivity filters [A20, sec. 4.1.1], a linearised L*a*b*.
inline Triple to_ycxcz(Triple rgb) {
    const Triple xyz = multiply(kToXyz.m, rgb);
    const double x = xyz.x / kWhite.x, y = xyz.y / kWhite.y, z = xyz.z / kWhite.z;
    return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

inline Triple from_ycxcz(Triple v) {
    const double y = (v.x + 16) / 116;
    return multiply(kFromXyz.m, {(v.y / 500 + y) * kWhite.x, y * kWhite.y, (y - v.z / 200) * kWhite.z});
}

/// CIE L*a*b* with the Hunt adjustment of its chroma [A20, sec. 4.1.2]: both chroma coordinates times 0.01 L*.
inline Triple to_hunt_lab(Triple rgb) {
    const Triple xyz = multiply(kToXyz.m, rgb);
    const auto f = [](double t) {
        constexpr double kDelta = 6.0 / 29;
        return t > kDelta * kDelta * kDelta ? cube_root(t) : t / (3 * kDelta * kDelta) + 4.0 / 29;
    };
    const double fx = f(xyz.x / kWhite.x), fy = f(xyz.y / kWhite.y), fz = f(xyz.z / kWhite.z);
    const double lightness = 116 * fy - 16;
    return {lightness, 0.01 * lightness * 500 * (fx - fy), 0.01 * lightness * 200 * (fy - fz)};
}

/// The HyAB distance: city block in lightness plus Euclidean in chroma [A20, sec. 4.1.2].
inline double hyab(Triple a, Triple b) {
    const double da = a.y - b.y, db = a.z - b.z;
    return std::fabs(a.x - b.x) + std::sqrt(da * da + db * db);
}

constexpr double kColorExponent = 0.7;     // q_c
constexpr double kColorSplit = 0.4;        // p_c
constexpr double kColorSplitValue = 0.95;  // p_t
constexpr double kFeatureExponent = 0.5;   // q_f
constexpr double kFeatureWidth = 0.082;    // w, in degrees

/// Maps the colour distance, raised to q_c, to [0, 1]; distances below 40 % of the largest take most of the range [A20,
/// sec. 4.1.3].
struct ColorErrorMap {
    double largest, split;
    ColorErrorMap() {
        largest = math::pow(hyab(to_hunt_lab({0, 1, 0}), to_hunt_lab({0, 0, 1})), kColorExponent);
        split = kColorSplit * largest;
    }
    double operator()(double distance) const {
        const double p = math::pow(distance, kColorExponent);
        if (p < split) return kColorSplitValue / split * p;
        return std::min(1.0, kColorSplitValue + (p - split) / (largest - split) * (1 - kColorSplitValue));
    }
};

/// One Gaussian a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees, of a contrast sensitivity function [A20, sec. 4.1.1].
struct CsfTerm {
    double a, b;
};
constexpr std::array<CsfTerm, 1> kCsfAchromatic{{{1, 0.0047}}};
constexpr std::array<CsfTerm, 1> kCsfRedGreen{{{1, 0.0053}}};
constexpr std::array<CsfTerm, 2> kCsfBlueYellow{{{34.1, 0.04}, {13.5, 0.025}}};
constexpr double kWidestCsf = 0.04;

int csf_radius(double ppd) { return int(std::ceil(3 * std::sqrt(kWidestCsf / (2 * kPiD * kPiD)) * ppd)); }

/// Filters with the sum of the terms' two-dimensional Gaussians, normalised to 1 over the square window. Each Gaussian is
/// separable; their sum is not, so each is applied by itself.
template <size_t N>
Plane filter_csf(const Plane& plane, const std::array<CsfTerm, N>& terms, double ppd) {
    const int radius = csf_radius(ppd);
    Plane result(plane.width, plane.height);
    std::array<double, N> share;
    double total = 0;
    for (size_t n = 0; n < N; ++n) {
        double sum = 0;
        for (int i = -radius; i <= radius; ++i) sum += math::exp(-kPiD * kPiD * i * i / (ppd * ppd * terms[n].b));
        share[n] = terms[n].a * std::sqrt(kPiD / terms[n].b) * sum * sum;
        total += share[n];
    }
    for (size_t n = 0; n < N; ++n) {
        Kernel kernel;
        double sum = 0;
        for (int i = -radius; i <= radius; ++i) sum += math::exp(-kPiD * kPiD * i * i / (ppd * ppd * terms[n].b));
        for (int i = -radius; i <= radius; ++i) {
            kernel.push_back(float(math::exp(-kPiD * kPiD * i * i / (ppd * ppd * terms[n].b)) / sum));
        }
        const Plane filtered = convolve_columns(convolve_rows(plane, kernel), kernel);
        const float weight = float(share[n] / total);
        for (size_t i = 0; i < result.values.size(); ++i) result.values[i] += weight * filtered.values[i];
    }
    return result;
}

/// A Gaussian and its first and second derivative, for edges and points [A20, sec. 4.2]. The Gaussian sums to 1; the
/// positive weights of the derivatives sum to 1 and the negative ones to -1.
struct FeatureKernels {
    Kernel gauss, edge, point;

    explicit FeatureKernels(double ppd) {
        const double sigma = 0.5 * kFeatureWidth * ppd;
        const int radius = int(std::ceil(3 * sigma));
        double gauss_sum = 0, edge_sum = 0, point_positive = 0, point_negative = 0;
        std::vector<double> g, e, p;
        for (int i = -radius; i <= radius; ++i) {
            const double weight = math::exp(-0.5 * i * i / (sigma * sigma));
            g.push_back(weight);
            e.push_back(-i * weight);
            p.push_back((i * i / (sigma * sigma) - 1) * weight);
            gauss_sum += weight;
            edge_sum += std::max(0.0, e.back());
            (p.back() > 0 ? point_positive : point_negative) += std::fabs(p.back());
        }
        for (size_t i = 0; i < g.size(); ++i) {
            gauss.push_back(float(g[i] / gauss_sum));
            edge.push_back(float(e[i] / edge_sum));
            point.push_back(float(p[i] / (p[i] > 0 ? point_positive : point_negative)));
        }
    }
};

/// The features of one image that are compared: the filtered colour, and the strength of edges and points.
struct Appearance {
    std::vector<Triple> color;  // Hunt-adjusted L*a*b*
    Plane edge, point;
};

Plane magnitude(const Plane& a, const Plane& b) {
    Plane result(a.width, a.height);
    for (size_t i = 0; i < result.values.size(); ++i) {
        result.values[i] = std::sqrt(a.values[i] * a.values[i] + b.values[i] * b.values[i]);
    }
    return result;
}

inline double clamp01(double v) { return clamp(v, 0.0, 1.0); }

/// `rgb` has 3 values in [0, 1] per pixel.
Appearance appearance_of(const std::vector<float>& rgb, int width, int height, double ppd) {
    Plane y(width, height), cx(width, height), cz(width, height), achromatic(width, height);
    for (size_t i = 0; i < y.values.size(); ++i) {
        const Triple v = to_ycxcz({rgb[i * 3], rgb[i * 3 + 1], rgb[i * 3 + 2]});
        y.values[i] = float(v.x), cx.values[i] = float(v.y), cz.values[i] = float(v.z);
        achromatic.values[i] = float((v.x + 16) / 116);
    }
    Appearance result;
    y = filter_csf(y, kCsfAchromatic, ppd);
    cx = filter_csf(cx, kCsfRedGreen, ppd);
    cz = filter_csf(cz, kCsfBlueYellow, ppd);
    result.color.reserve(y.values.size());
    for (size_t i = 0; i < y.values.size(); ++i) {
        const Triple c = from_ycxcz({y.values[i], cx.values[i], cz.values[i]});
        result.color.push_back(to_hunt_lab({clamp01(c.x), clamp01(c.y), clamp01(c.z)}));
    }
    const FeatureKernels kernels(ppd);
    const Plane smooth_x = convolve_rows(achromatic, kernels.gauss);
    result.edge = magnitude(convolve_columns(convolve_rows(achromatic, kernels.edge), kernels.gauss),
                            convolve_columns(smooth_x, kernels.edge));
    result.point = magnitude(convolve_columns(convolve_rows(achromatic, kernels.point), kernels.gauss),
                             convolve_columns(smooth_x, kernels.point));
    return result;
}

std::vector<float> difference(const Appearance& a, const Appearance& b) {
    static const ColorErrorMap kColorError;
    std::vector<float> map(a.color.size());
    for (size_t i = 0; i < map.size(); ++i) {
        const double color = kColorError(hyab(a.color[i], b.color[i]));
        const double feature =
            std::max(std::fabs(a.edge.values[i] - b.edge.values[i]), std::fabs(a.point.values[i] - b.point.values[i]));
        // [A20, sec. 4.2]: a difference of sqrt(2) is the largest.
        static_assert(kFeatureExponent == 0.5);
        const double feature_error = std::min(1.0, std::sqrt(feature * 0.70710678118654752440));
        map[i] = color == 0 ? 0.0f : float(math::pow(color, 1 - feature_error));  // [A20, sec. 4.3]
    }
    return map;
}

/// Rational fit of the ACES curve, including its exposure of 0.6 [A21, sec. 3]: (k0 x^2 + k1 x) / (k2 x^2 + k3 x + k4).
constexpr double kAces[5] = {0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14};

inline double aces(double x) {
    x = std::max(x, 0.0);
    if (x > 1e8) return 1;  // Beyond the curve's shoulder the quotient exceeds 1 and loses digits.
    return clamp01((kAces[0] * x + kAces[1]) * x / ((kAces[2] * x + kAces[3]) * x + kAces[4]));
}

/// The x for which the ACES curve is `t`.
double inverse_aces(double t) {
    const double a = kAces[0] - t * kAces[2], b = kAces[1] - t * kAces[3], c = -t * kAces[4];
    return (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);
}

double log2(double v) { return math::log(v) * 1.44269504088896340736; }

}  // namespace

std::vector<float> ldr_flip(const RgbImage& image, const RgbImage& reference, double ppd) {
    const auto clamped = [](const RgbImage& source) {
        std::vector<float> rgb = source.pixels;
        for (float& v : rgb) v = clamp(v, 0.0f, 1.0f);
        return rgb;
    };
    return difference(appearance_of(clamped(image), image.width, image.height, ppd),
                      appearance_of(clamped(reference), reference.width, reference.height, ppd));
}

HdrFlip hdr_flip(const RgbImage& image, const RgbImage& reference, double ppd) {
    std::vector<float> luminance(reference.pixels.size() / 3);
    for (size_t i = 0; i < luminance.size(); ++i) {
        const float* p = reference.pixels.data() + i * 3;
        luminance[i] = Rgb(p[0], p[1], p[2]).luminance();
    }
    HdrFlip result;
    result.map.resize(luminance.size());
    const double largest = *std::max_element(luminance.begin(), luminance.end());
    std::nth_element(luminance.begin(), luminance.begin() + ptrdiff_t(luminance.size() / 2), luminance.end());
    const double median = std::max(double(luminance[luminance.size() / 2]), largest * 0x1p-24);
    if (largest > 0) {  // A black reference keeps its exposure.
        const double target = inverse_aces(0.85);
        result.start_exposure = log2(target / largest);
        result.stop_exposure = log2(target / median);
    }
    const double range = result.stop_exposure - result.start_exposure;
    result.exposures = range > 0 ? std::max(2, int(std::ceil(range))) : 1;
    const double step = result.exposures > 1 ? range / (result.exposures - 1) : 0;
    for (int n = 0; n < result.exposures; ++n) {
        const double scale = math::pow(2, result.start_exposure + n * step);
        const auto tone_mapped = [&](const RgbImage& source) {
            std::vector<float> rgb(source.pixels.size());
            for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = float(aces(source.pixels[i] * scale));
            return rgb;
        };
        const Appearance test = appearance_of(tone_mapped(image), image.width, image.height, ppd);
        const Appearance wanted = appearance_of(tone_mapped(reference), image.width, image.height, ppd);
        const std::vector<float> map = difference(test, wanted);
        for (size_t i = 0; i < map.size(); ++i) result.map[i] = std::max(result.map[i], map[i]);
    }
    return result;
}

}  // namespace lightloom
