// The metrics against values computed by hand, and the properties that they must have.

#include "common/metrics/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/core/rng.h"
#include "common/metrics/flip.h"
#include "common/metrics/significance.h"

namespace lightloom {
namespace {

RgbImage grey(int width, int height, float value) {
    return {width, height, std::vector<float>(size_t(width) * size_t(height) * 3, value)};
}

RgbImage scene_like(int width, int height) {
    RgbImage image = grey(width, height, 0);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            float* p = image.pixels.data() + (size_t(y) * size_t(width) + size_t(x)) * 3;
            p[0] = 0.1f + 0.8f * float(x) / float(width);
            p[1] = (x / 8 + y / 8) % 2 ? 0.7f : 0.2f;
            p[2] = 0.05f + float(y) / float(height);
        }
    }
    return image;
}

RgbImage with_noise(const RgbImage& image, float strength) {
    RgbImage noisy = image;
    Rng rng({17});
    for (float& v : noisy.pixels) v = std::max(0.0f, v + strength * (rng.uniform() - 0.5f));
    return noisy;
}

Metrics metrics_of(const RgbImage& image, const RgbImage& reference, double trim = 0.1) {
    const Result<Metrics> m = compute_metrics(image, reference, trim);
    EXPECT_TRUE(m.ok()) << m.status().message();
    return *m;
}

double mean(const std::vector<float>& map) {
    double sum = 0;
    for (float v : map) sum += v;
    return sum / double(map.size());
}

TEST(Metrics, ByHandOnTwoByTwo) {
    // Pixels: equal; 1 against 0.5 in red; 20 against 0 in all channels; 0 against 0.99 in blue.
    const RgbImage x{2, 2, {1, 1, 1, 1, 0.5f, 0.5f, 20, 20, 20, 0.25f, 0.25f, 0}};
    const RgbImage r{2, 2, {1, 1, 1, 0.5f, 0.5f, 0.5f, 0, 0, 0, 0.25f, 0.25f, 0.99f}};
    const Metrics m = metrics_of(x, r, 25);
    const double b = 0.99f;
    const double e1 = 0.5 / 0.51 / 3, e2 = 20 / 0.01, e3 = b / (b + 0.01) / 3;
    EXPECT_NEAR(m.mape_unclamped, 100 * (e1 + e2 + e3) / 4, 1e-9);
    EXPECT_NEAR(m.mape, 100 * (e1 + 10 + e3) / 4, 1e-9);
    const double t1 = 0.25 / 0.26, t2 = 400 / 0.01, t3 = b * b / (b * b + 0.01);
    EXPECT_NEAR(m.relmse, (t1 + 3 * t2 + t3) / 12, 1e-9);
    EXPECT_NEAR(m.relmse_trimmed, (t1 + t3) / 9, 1e-12);  // A quarter of twelve terms: the three of the third pixel.
    EXPECT_NEAR(m.rmse, std::sqrt((0.25 + 1200 + b * b) / 12), 1e-9);
    const double s1 = 0.5 / 0.75;
    EXPECT_NEAR(m.srrmse, std::sqrt((s1 * s1 + 3 * 4 + 4) / 12), 1e-9);
    const double sum_x = 3 + 2 + 60 + 2 * 0.25, sum_r = 3 + 1.5 + 2 * 0.25 + b;
    EXPECT_NEAR(m.mean_ratio, sum_x / sum_r, 1e-9);
    EXPECT_NEAR(m.mean_image[0], (1 + 1 + 20 + 0.25) / 4, 1e-9);
    EXPECT_NEAR(m.mean_reference[2], (1 + 0.5 + b) / 4, 1e-9);
}

TEST(Metrics, EqualImages) {
    for (const RgbImage& image : {scene_like(40, 30), scene_like(5, 3), grey(16, 16, 0)}) {
        const Metrics m = metrics_of(image, image);
        for (double v : {m.mape, m.mape_unclamped, m.relmse, m.relmse_trimmed, m.rmse, m.srrmse, m.flip, m.hdr_flip}) {
            EXPECT_EQ(v, 0);
        }
        EXPECT_NEAR(m.ssim, 1, 1e-12);
        EXPECT_EQ(m.mean_ratio, 1);
    }
}

TEST(Metrics, GrowWithNoise) {
    const RgbImage reference = scene_like(64, 48);
    Metrics before = metrics_of(reference, reference);
    for (const float strength : {0.02f, 0.05f, 0.15f, 0.4f, 1.0f}) {
        const Metrics m = metrics_of(with_noise(reference, strength), reference);
        EXPECT_GT(m.mape, before.mape);
        EXPECT_GT(m.relmse, before.relmse);
        EXPECT_GT(m.relmse_trimmed, before.relmse_trimmed);
        EXPECT_LT(m.relmse_trimmed, m.relmse);
        EXPECT_GT(m.rmse, before.rmse);
        EXPECT_GT(m.srrmse, before.srrmse);
        EXPECT_LT(m.ssim, before.ssim);
        EXPECT_GT(m.flip, before.flip);
        EXPECT_GT(m.hdr_flip, before.hdr_flip);
        before = m;
    }
}

TEST(Metrics, RelativeOnesDoNotSeeTheLightsScaleMuch) {
    const RgbImage reference = scene_like(32, 32), noisy = with_noise(reference, 0.2f);
    RgbImage r = reference, x = noisy;
    for (float& v : r.pixels) v *= 64;
    for (float& v : x.pixels) v *= 64;
    const Metrics small = metrics_of(noisy, reference), large = metrics_of(x, r);
    EXPECT_NEAR(large.srrmse, small.srrmse, 1e-6);
    EXPECT_NEAR(large.mean_ratio, small.mean_ratio, 1e-9);
    EXPECT_NEAR(large.rmse, 64 * small.rmse, 1e-5);
    EXPECT_NEAR(large.hdr_flip, small.hdr_flip, 1e-4);  // The exposures follow the reference.
}

TEST(Metrics, RefuseWhatCannotBeCompared) {
    EXPECT_FALSE(compute_metrics(grey(3, 2, 1), grey(2, 3, 1)).ok());
    EXPECT_FALSE(compute_metrics(RgbImage{}, RgbImage{}).ok());
    EXPECT_FALSE(compute_metrics(grey(2, 2, 1), grey(2, 2, 1), 100).ok());
    EXPECT_FALSE(compute_metrics(grey(2, 2, 1), grey(2, 2, 1), -1).ok());
    RgbImage bad = grey(3, 3, 1);
    bad.pixels[14] = std::numeric_limits<float>::quiet_NaN();
    const Status status = compute_metrics(bad, grey(3, 3, 1)).status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(status.message().find("image is NaN or infinite at pixel (1, 1)"), std::string::npos) << status.message();
    ExrImage a, b;
    a.frame = {8, 8, {0, 0, 8, 8}};
    b.frame = {8, 8, {0, 0, 8, 7}};
    EXPECT_FALSE(check_comparable(a, b).ok());
    EXPECT_TRUE(check_comparable(a, a).ok());
}

TEST(Metrics, RegionsCoverTheImageOnce) {
    const RgbImage reference = scene_like(31, 17);
    RgbImage image = reference;
    for (size_t i = 0; i < 10 * 3; ++i) image.pixels[i] *= 2;  // Top row, left third.
    const Result<std::vector<RegionRatio>> regions = region_ratios(image, reference, 3, 3);
    ASSERT_TRUE(regions.ok());
    ASSERT_EQ(regions->size(), 9u);
    int64_t area = 0;
    for (const RegionRatio& r : *regions) area += r.rect.area();
    EXPECT_EQ(area, 31 * 17);
    EXPECT_GT((*regions)[0].ratio, 1.05);
    for (size_t i = 1; i < 9; ++i) EXPECT_EQ((*regions)[i].ratio, 1);
    EXPECT_FALSE(region_ratios(image, reference, 0, 3).ok());
    EXPECT_FALSE(region_ratios(image, reference, 32, 3).ok());
}

TEST(Metrics, ErrorPictureIsBlueBelowAndRedAbove) {
    const RgbImage image{3, 1, {0, 0, 0, 1, 1, 1, 9, 9, 9}}, reference = grey(3, 1, 1);
    const std::vector<uint8_t> p = signed_error_picture(image, reference);
    EXPECT_GT(p[2], 250);
    EXPECT_LT(p[0], 5);
    EXPECT_EQ(std::vector<uint8_t>(p.begin() + 3, p.begin() + 6), (std::vector<uint8_t>{255, 255, 255}));
    EXPECT_EQ(std::vector<uint8_t>(p.begin() + 6, p.end()), (std::vector<uint8_t>{255, 0, 0}));
}

// Constant images a and b: mean, variance and covariance leave only the luminance term of SSIM.
TEST(Ssim, ConstantImages) {
    const auto encode = [](double v) { return 1.055 * std::pow(v, 1 / 2.4) - 0.055; };
    const double a = encode(0.25), b = encode(0.5), c1 = 1e-4;
    EXPECT_NEAR(ssim(grey(20, 20, 0.25f), grey(20, 20, 0.5f)), (2 * a * b + c1) / (a * a + b * b + c1), 1e-6);
    EXPECT_NEAR(ssim(grey(4, 4, 0.25f), grey(4, 4, 0.5f)), (2 * a * b + c1) / (a * a + b * b + c1), 1e-6);
    EXPECT_NEAR(ssim(grey(20, 20, 7), grey(20, 20, 1)), 1, 1e-6);  // Both are white when clamped.
}

// Black against white: HyAB is 100, which the error map of the paper takes to 0.967; no edges, no points.
TEST(Flip, BlackAgainstWhite) {
    const std::vector<float> map = ldr_flip(grey(30, 30, 0), grey(30, 30, 1));
    for (float v : map) EXPECT_NEAR(v, 0.967, 1e-3);
}

TEST(Flip, GreenAgainstBlueIsTheLargestColourError) {
    RgbImage green = grey(30, 30, 0), blue = green;
    for (size_t i = 0; i < green.pixels.size(); i += 3) green.pixels[i + 1] = blue.pixels[i + 2] = 1;
    EXPECT_NEAR(mean(ldr_flip(green, blue)), 1, 1e-3);
}

TEST(Flip, SymmetricBoundedAndBlindToWhatCannotBeSeen) {
    const RgbImage a = scene_like(70, 50), b = with_noise(a, 0.5f);
    const std::vector<float> ab = ldr_flip(a, b), ba = ldr_flip(b, a);
    for (size_t i = 0; i < ab.size(); ++i) {
        ASSERT_NEAR(ab[i], ba[i], 1e-6);
        ASSERT_GE(ab[i], 0);
        ASSERT_LE(ab[i], 1);
    }
    // A fine checkerboard is close to its mean at 67 pixels per degree, but far from it when each pixel is a degree wide.
    RgbImage fine = grey(64, 64, 0.5f);
    for (size_t i = 0; i < fine.pixels.size(); ++i) fine.pixels[i] = ((i / 3) % 64 + i / 192) % 2 ? 0.6f : 0.4f;
    EXPECT_LT(mean(ldr_flip(fine, grey(64, 64, 0.5f))), 0.25 * mean(ldr_flip(fine, grey(64, 64, 0.5f), 3)));
}

TEST(Flip, HdrSeesWhatClampingHides) {
    RgbImage reference = scene_like(64, 64), image = reference;
    for (size_t y = 20; y < 40; ++y) {
        for (size_t x = 20; x < 40; ++x) {
            for (size_t c = 0; c < 3; ++c) {
                reference.pixels[(y * 64 + x) * 3 + c] = 50;
                image.pixels[(y * 64 + x) * 3 + c] = 20;
            }
        }
    }
    EXPECT_EQ(mean(ldr_flip(image, reference)), 0);
    const HdrFlip flip = hdr_flip(image, reference);
    EXPECT_GT(mean(flip.map), 0.01);
    EXPECT_LT(flip.start_exposure, flip.stop_exposure);
    EXPECT_EQ(flip.exposures, int(std::ceil(flip.stop_exposure - flip.start_exposure)));
}

TEST(Significance, IsThatOfTables) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    EXPECT_NEAR(student_quantile(0.05, 1), 12.7062, 1e-4);
    EXPECT_NEAR(student_quantile(0.05, 10), 2.228139, 1e-6);
    EXPECT_NEAR(student_quantile(0.01, 30), 2.749996, 1e-6);
    EXPECT_NEAR(student_quantile(0.05, kInfinity), 1.959964, 1e-6);
    EXPECT_NEAR(student_p_value(-12.7062, 1), 0.05, 1e-6);
    EXPECT_NEAR(student_p_value(1.959964, kInfinity), 0.05, 1e-7);
    EXPECT_NEAR(normal_p_value(-1.959964), 0.05, 1e-7);
    EXPECT_NEAR(1 - std::pow(1 - sidak(0.05, 7), 7), 0.05, 1e-12);
}

TEST(Significance, HasAnAnswerAtTheEndsOfItsRange) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(normal_p_value(0), 1);
    EXPECT_EQ(normal_p_value(kInfinity), 0);
    EXPECT_EQ(student_p_value(0, 3), 1);
    EXPECT_EQ(student_p_value(kInfinity, 3), 0);
    // Far out in the tail nothing cancels to zero.
    EXPECT_GT(normal_p_value(12), 1e-33);
    EXPECT_TRUE(std::isnan(normal_p_value(kNan)));
    EXPECT_TRUE(std::isnan(student_p_value(kNan, 3)));
}

}  // namespace
}  // namespace lightloom
