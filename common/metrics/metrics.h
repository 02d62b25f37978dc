#pragma once
// Distances of an image from a reference. Both are linear HDR RGB; x is the image, r the reference. Unless stated
// otherwise a metric is a mean over pixels and channels. Conventions differ between papers, so that each one is spelled
// out here.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/film/accumulation.h"
#include "common/film/exr_io.h"

namespace lightloom {

struct Metrics {
    /// Per pixel e = min((1/3) sum_c |x_c - r_c| / (|r_c| + 0.01), 10); 100 % times the mean of e. In percent.
    double mape = 0;
    double mape_unclamped = 0;  ///< The same without min(., 10).
    /// Mean of (x - r)^2 / (r^2 + 0.01). (pbrt-v4's MRSE divides by (r + 0.01)^2 instead.)
    double relmse = 0;
    /// relMSE over the terms that remain after the largest `trim_percent` percent of its terms (rounded down) were
    /// dropped.
    double relmse_trimmed = 0;
    double trim_percent = 0;
    double rmse = 0;        ///< sqrt of the mean of (x - r)^2.
    double srrmse = 0;      ///< sqrt of the mean of [(x - r) / ((|x| + |r|) / 2)]^2 with 0/0 = 0; at most 2.
    double ssim = 0;        ///< See ssim(). 1 for equal images.
    double flip = 0;        ///< Mean of ldr_flip() at kFlipPixelsPerDegree. 0 for equal images, at most 1.
    double hdr_flip = 0;    ///< Mean of hdr_flip() at kFlipPixelsPerDegree.
    double mean_ratio = 0;  ///< sum x / sum r over all pixels and channels: it shows bias. 1 if both sums are 0.
    std::array<double, 3> mean_image{}, mean_reference{};  ///< Per channel.
};

/// One cell of a grid laid over the image.
struct RegionRatio {
    Rect rect;                                  ///< Relative to the image's corner.
    double mean_image = 0, mean_reference = 0;  ///< Over pixels and channels.
    double ratio = 0;                           ///< As Metrics::mean_ratio.
};

/// kInvalidArgument if the sizes differ, an image is empty, `trim_percent` is not in [0, 100), or a value is NaN or
/// infinite (the message names the first such pixel).
Result<Metrics> compute_metrics(const RgbImage& image, const RgbImage& reference, double trim_percent = 0.1);

/// The same without the perceptual metrics (ssim, flip and hdr_flip stay 0), which take a hundred times as long; for
/// error curves with many points.
Result<Metrics> compute_pixel_metrics(const RgbImage& image, const RgbImage& reference, double trim_percent = 0.1);

/// Ratios of means in `columns` x `rows` cells of nearly equal size, row by row. The images are of equal size.
Result<std::vector<RegionRatio>> region_ratios(const RgbImage& image, const RgbImage& reference, int columns, int rows);

/// Mean structural similarity [Wang, Bovik, Sheikh, Simoncelli 2004]: Gaussian window of 11 x 11, sigma 1.5, K1 = 0.01,
/// K2 = 0.03, L = 1, on the Rec.709 luma of the sRGB-encoded image clamped to [0, 1]; mean over the pixels whose window
/// lies inside the image, as in the authors' code. For images smaller than 11 pixels the mean is over all pixels, with
/// windows cut at the border and renormalised.
double ssim(const RgbImage& image, const RgbImage& reference);

/// Refuses to compare pictures of different frames or crop windows, with one line that names both sizes.
Status check_comparable(const ExrImage& image, const ExrImage& reference);

/// Signed relative error (L(x) - L(r)) / (|L(r)| + 0.01) of the luminance as 8-bit RGB: white for none, towards blue where
/// the image is darker than the reference, towards red where it is brighter; full colour at +-`range`.
std::vector<uint8_t> signed_error_picture(const RgbImage& image, const RgbImage& reference, double range = 1);

}  // namespace lightloom
