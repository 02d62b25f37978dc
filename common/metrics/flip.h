#pragma once
// FLIP, a perceptual difference between two images that are shown alternately: our own implementation from the papers
//   [A20] Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem, Fairchild: FLIP: A Difference Evaluator for Alternating
//         Images. HPG 2020.
//   [A21] Andersson, Nilsson, Shirley, Akenine-Moeller: Visualizing Errors in Rendered High Dynamic Range Images.
//         Eurographics short papers 2021.

#include <vector>

#include "common/core/math.h"
#include "common/film/accumulation.h"

namespace lightloom {

/// Pixels that one degree of the view spans 0.7 m in front of a display 0.7 m wide with 3840 pixels, 67.02: the papers'
/// default.
inline constexpr double kFlipPixelsPerDegree = 0.7 * 3840 / 0.7 * (kPiD / 180);

/// Error per pixel in [0, 1], row-major. Both images are linear RGB and are clamped to [0, 1] first. They must be
/// finite and of equal size.
std::vector<float> ldr_flip(const RgbImage& image, const RgbImage& reference, double pixels_per_degree = kFlipPixelsPerDegree);

struct HdrFlip {
    std::vector<float> map;                        ///< Maximum over the exposures of the LDR-FLIP of the tone-mapped images.
    double start_exposure = 0, stop_exposure = 0;  ///< In stops, computed from the reference alone.
    int exposures = 0;
};

/// HDR-FLIP [A21] with the ACES curve and the automatic range of exposures: the brightest pixel of the reference, and its
/// median, are brought to 85 % of white. Negative values are shown as black. The median is taken as at least 2^-24 of the
/// maximum, so that a reference which is mostly black has a finite range; the authors' code has no answer there.
HdrFlip hdr_flip(const RgbImage& image, const RgbImage& reference, double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace lightloom
