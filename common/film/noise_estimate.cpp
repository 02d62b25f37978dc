#include "common/film/noise_estimate.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace lightloom {
namespace {

constexpr int kRadius = 2;  // of the filter's window
constexpr int kChannels = 3;

/// Sums over the rows of a window, one per column and channel.
struct ColumnSums {
    std::vector<double> value, square, variance;
    explicit ColumnSums(size_t values) : value(values), square(values), variance(values) {}

    void clear() {
        for (std::vector<double>* sums : {&value, &square, &variance}) std::fill(sums->begin(), sums->end(), 0.0);
    }
    void add(const double* mean, const double* moment, double factor) {
        for (size_t i = 0; i < value.size(); ++i) {
            value[i] += mean[i];
            square[i] += mean[i] * mean[i];
            variance[i] += moment[i] * factor;
        }
    }
};

/// Sums over the neighbours of a value.
struct Neighbours {
    double value, square, variance, count;
};

/// Square of the value that the filter gives: between the pixel's own and its neighbours' mean, without a pixel in its own
/// background, so that a single spike stands out.
double filtered_square(double own, double own_variance, const Neighbours& others) {
    if (others.count < 1) return own * own;
    const double local = others.value / others.count;
    // The variance between pixels is contrast and noise together.
    const double spread = others.count > 1 ? (others.square - others.value * local) / (others.count - 1) : 0;
    const double contrast = std::max(0.0, spread - others.variance / others.count);
    const double own_share = contrast > 0 ? contrast / (contrast + own_variance) : 0;
    const double filtered = local + own_share * (own - local);
    return filtered * filtered;
}

/// Square of what a pixel shows for certain, however different its neighbours are. Light that some nine groups have found counts;
/// a spike of a single sample has a variance of its square.
double known_square(double own_square, double own_variance) { return own_square - 9 * own_variance; }

}  // namespace

void GroupSpread::add(double value) {
    ++count_;
    const double delta = value - mean_;
    mean_ += delta / count_;
    moment_ += delta * (value - mean_);
}

void GroupSpread::write_state(StateWriter& out) const {
    out.put(count_);
    out.put(mean_);
    out.put(moment_);
}

void GroupSpread::read_state(StateReader& in) {
    count_ = in.get<uint32_t>();
    mean_ = in.get<double>();
    moment_ = in.get<double>();
}

double GroupSpread::relative_error() const {
    if (count_ == 0 || !(mean_ > 0)) return 0;
    // The square of a normal variable has the relative standard deviation sqrt(2).
    if (count_ + 1 < NoiseEstimate::kLeastGroups) return std::sqrt(2.0 / count_);
    return std::sqrt(moment_ / (count_ - 1.0) / count_) / mean_;
}

double relative_variance(const MeanOfRow& mean, const double* moment, int width, int height, double variance_factor,
                         double epsilon) {
    constexpr int kRows = 2 * kRadius + 1;
    const size_t row_values = size_t(width) * kChannels;
    // The rows of the window, each in the place that its number gives.
    std::vector<double> means(row_values * kRows);
    const auto row = [&](int y) { return means.data() + size_t(y % kRows) * row_values; };
    int known_rows = 0;
    ColumnSums columns(row_values);
    double total = 0;
    for (int y = 0; y < height; ++y) {
        const int top = std::max(0, y - kRadius), bottom = std::min(height - 1, y + kRadius);
        for (; known_rows <= bottom; ++known_rows) mean(known_rows, row(known_rows));
        // Running sums would keep the rounding errors of bright pixels that have left the window.
        columns.clear();
        for (int j = top; j <= bottom; ++j) columns.add(row(j), moment + size_t(j) * row_values, variance_factor);
        double row_total = 0;
        for (int x = 0; x < width; ++x) {
            const int left = std::max(0, x - kRadius), right = std::min(width - 1, x + kRadius);
            const double count = double(bottom - top + 1) * double(right - left + 1);
            for (int c = 0; c < kChannels; ++c) {
                double value = 0, square = 0, variance = 0;
                for (int i = left; i <= right; ++i) {
                    const size_t column = size_t(i) * kChannels + size_t(c);
                    value += columns.value[column];
                    square += columns.square[column];
                    variance += columns.variance[column];
                }
                const size_t index = size_t(y) * row_values + size_t(x) * kChannels + size_t(c);
                const double own = row(y)[size_t(x) * kChannels + size_t(c)], own_square = own * own,
                             own_variance = moment[index] * variance_factor;
                row_total += own_variance /
                             (std::max(known_square(own_square, own_variance),
                                       filtered_square(own, own_variance,
                                                       {value - own, square - own_square, variance - own_variance, count - 1})) +
                              epsilon);
            }
        }
        total += row_total;
    }
    return total / (double(height) * double(row_values));
}

}  // namespace lightloom
