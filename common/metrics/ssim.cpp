#include <algorithm>

#include "common/core/math.h"
#include "common/core/vec.h"
#include "common/film/png.h"
#include "common/metrics/convolution.h"
#include "common/metrics/metrics.h"

namespace lightloom {

namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;  // (K L)^2 with L = 1

Plane luma(const RgbImage& image) {
    Plane plane(image.width, image.height);
    for (size_t p = 0; p < plane.values.size(); ++p) {
        float encoded[3];
        for (size_t c = 0; c < 3; ++c) encoded[c] = float(srgb_encode(clamp(image.pixels[p * 3 + c], 0.0f, 1.0f)));
        plane.values[p] = Rgb(encoded[0], encoded[1], encoded[2]).luminance();
    }
    return plane;
}

/// Weighted means of a, b and their products in the window around (x, y). They are kept in double, because variances
/// are differences of nearly equal numbers.
struct Moments {
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0, weight = 0;
    void add(const Moments& o, double w) {
        a += w * o.a, b += w * o.b, aa += w * o.aa, bb += w * o.bb, ab += w * o.ab, weight += w * o.weight;
    }
};

}  // namespace

double ssim(const RgbImage& image, const RgbImage& reference) {
    const Plane a = luma(image), b = luma(reference);
    const int width = a.width, height = a.height;
    double gauss[2 * kRadius + 1];
    for (int i = -kRadius; i <= kRadius; ++i) gauss[i + kRadius] = math::exp(-0.5 * i * i / (kSigma * kSigma));

    std::vector<Moments> rows(a.values.size());
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            Moments& m = rows[size_t(y) * size_t(width) + size_t(x)];
            for (int k = std::max(-kRadius, -x); k <= std::min(kRadius, width - 1 - x); ++k) {
                const size_t i = size_t(y) * size_t(width) + size_t(x + k);
                const double u = a.values[i], v = b.values[i];
                m.add({u, v, u * u, v * v, u * v, 1}, gauss[k + kRadius]);
            }
        }
    }
    const bool inside_only = width > 2 * kRadius && height > 2 * kRadius;
    const int margin = inside_only ? kRadius : 0;
    double sum = 0;
    for (int y = margin; y < height - margin; ++y) {
        for (int x = margin; x < width - margin; ++x) {
            Moments m;
            for (int k = std::max(-kRadius, -y); k <= std::min(kRadius, height - 1 - y); ++k) {
                m.add(rows[size_t(y + k) * size_t(width) + size_t(x)], gauss[k + kRadius]);
            }
            const double ma = m.a / m.weight, mb = m.b / m.weight;
            const double va = m.aa / m.weight - ma * ma, vb = m.bb / m.weight - mb * mb, cov = m.ab / m.weight - ma * mb;
            sum += ((2 * ma * mb + kC1) * (2 * cov + kC2)) / ((ma * ma + mb * mb + kC1) * (va + vb + kC2));
        }
    }
    return sum / (double(width - 2 * margin) * double(height - 2 * margin));
}

}  // namespace lightloom
