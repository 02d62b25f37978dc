#include "client/thumbnail.h"

#include <algorithm>
#include <cmath>

namespace lightloom::client {
namespace {

/// Mean luminance that pictures are brightened to.
constexpr double kShownMean = 0.25;

}  // namespace

double mean_luminance(const RgbImage& image) {
    double sum = 0;
    const size_t pixels = image.pixels.size() / 3;
    for (size_t i = 0; i < pixels; ++i) {
        const float* rgb = &image.pixels[3 * i];
        sum += 0.2126 * double(rgb[0]) + 0.7152 * double(rgb[1]) + 0.0722 * double(rgb[2]);
    }
    return sum / double(pixels);
}

int stops_for(double mean) { return mean > 0 ? std::clamp(int(std::lround(std::log2(kShownMean / mean))), -10, 20) : 0; }

RgbImage thumbnail(const RgbImage& image, int width) {
    const int side = (image.width + width - 1) / width;
    if (side <= 1) return image;
    RgbImage small{std::max(1, image.width / side), std::max(1, image.height / side), {}};
    small.pixels.resize(size_t(3) * size_t(small.width) * size_t(small.height));
    const int rows = std::min(side, image.height);
    for (int y = 0; y < small.height; ++y) {
        for (int x = 0; x < small.width; ++x) {
            for (int c = 0; c < 3; ++c) {
                double sum = 0;
                for (int j = 0; j < rows; ++j)
                    for (int i = 0; i < side; ++i)
                        sum += double(
                            image.pixels[3 * (size_t(y * side + j) * size_t(image.width) + size_t(x * side + i)) + size_t(c)]);
                small.pixels[3 * (size_t(y) * size_t(small.width) + size_t(x)) + size_t(c)] = float(sum / (rows * side));
            }
        }
    }
    return small;
}

}  // namespace lightloom::client
