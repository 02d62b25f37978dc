#pragma once
// Images as pictures of pages.

#include "common/film/accumulation.h"

namespace lightloom::client {

/// Mean Rec.709 luminance.
double mean_luminance(const RgbImage& image);

/// Whole stops by which an image of this mean luminance is brightened for a picture, in [-10, 20]; 0 for a black one.
int stops_for(double mean);

/// The image at most `width` pixels wide. Every pixel is a mean over a block, so that the few bright pixels of a sparse picture
/// stay.
RgbImage thumbnail(const RgbImage& image, int width);

}  // namespace lightloom::client
