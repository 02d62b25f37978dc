#include "common/metrics/region_means.h"

#include <algorithm>
#include <cmath>

#include "common/core/vec.h"
#include "common/metrics/significance.h"

namespace lightloom {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Pixels are floats: means that differ by less than this fraction are equal, whatever their variance says.
constexpr double kFloatResolution = 2e-6;

}  // namespace

double Estimate::standard_error() const { return std::sqrt(variance); }

void WeightedMean::add(double value, double weight) {
    weight_ += weight;
    const double delta = value - mean_;
    mean_ += delta * (weight / weight_);
    moment_ += weight * delta * (value - mean_);
    ++count_;
}

Estimate WeightedMean::estimate() const {
    if (count_ < 2) return {mean_, kInfinity, 1};
    return {mean_, moment_ / (double(count_ - 1) * weight_), double(count_ - 1)};
}

RegionMeans::RegionMeans(int columns, int rows) : columns_(columns), rows_(rows), means_(size_t(1 + columns * rows)) {}

void RegionMeans::add(const RgbImage& group, double weight) {
    const std::vector<double> means = luminance_means(group, columns_, rows_);
    for (size_t r = 0; r < means.size(); ++r) means_[r].add(means[r], weight);
}

std::vector<Estimate> RegionMeans::estimates() const {
    std::vector<Estimate> estimates;
    for (const WeightedMean& mean : means_) estimates.push_back(mean.estimate());
    return estimates;
}

std::vector<double> luminance_means(const RgbImage& image, int columns, int rows) {
    std::vector<double> sums(size_t(1 + columns * rows)), counts(sums.size());
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            const float* p = &image.pixels[(size_t(y) * size_t(image.width) + size_t(x)) * 3];
            const int column = int(int64_t(x) * columns / image.width), row = int(int64_t(y) * rows / image.height);
            for (const size_t r : {size_t(0), size_t(1 + row * columns + column)}) {
                sums[r] += Rgb(p[0], p[1], p[2]).luminance();
                counts[r] += 1;
            }
        }
    }
    for (size_t r = 0; r < sums.size(); ++r) sums[r] = counts[r] > 0 ? sums[r] / counts[r] : 0;
    return sums;
}

RatioInterval ratio_interval(const Estimate& image, const Estimate& reference, double level) {
    if (reference.mean == 0) {
        if (image.mean == 0) return {};
        const bool zero = std::fabs(image.mean) <= student_quantile(level, image.degrees) * image.standard_error();
        return {kInfinity, zero ? 0 : kInfinity, kInfinity};
    }
    const double ratio = image.mean / reference.mean;
    const double from_image = image.variance, from_reference = ratio * ratio * reference.variance;
    const double variance = from_image + from_reference;
    if (!(variance < kInfinity)) return {ratio, -kInfinity, kInfinity};
    double half = kFloatResolution * std::max(1.0, std::fabs(ratio));
    if (variance > 0) {
        const double degrees =
            variance * variance / (from_image * from_image / image.degrees + from_reference * from_reference / reference.degrees);
        half += student_quantile(level, degrees) * std::sqrt(variance) / std::fabs(reference.mean);
    }
    return {ratio, ratio - half, ratio + half};
}

}  // namespace lightloom
