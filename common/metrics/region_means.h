#pragma once
// Mean luminance of an image and of its regions, with error estimates from independent group images, and intervals for
// the ratio of two such means, by which two renderings are compared.

#include <limits>
#include <vector>

#include "common/film/accumulation.h"
#include "common/film/frame.h"

namespace lightloom {

/// A mean with an estimate of its error.
struct Estimate {
    double mean = 0;
    double variance = 0;                                       ///< Variance of the mean.
    double degrees = std::numeric_limits<double>::infinity();  ///< Degrees of freedom of the variance.

    double standard_error() const;
};

/// Mean of independent values of different weight (the iterations of a group): sum n x / sum n, with the variance sum n
/// (x - mean)^2 / ((G - 1) sum n). With fewer than two values the variance is infinite.
class WeightedMean {
  public:
    void add(double value, double weight);
    int count() const { return count_; }
    Estimate estimate() const;

  private:
    double weight_ = 0, mean_ = 0, moment_ = 0;
    int count_ = 0;
};

/// Mean luminance of the whole image ([0]) and of a grid of regions (row by row from [1]).
class RegionMeans {
  public:
    RegionMeans(int columns, int rows);
    /// Adds one group image. All have the same size, with at least as many pixels as regions in each direction.
    void add(const RgbImage& group, double weight);
    std::vector<Estimate> estimates() const;

  private:
    int columns_, rows_;
    std::vector<WeightedMean> means_;
};

/// Mean Rec.709 luminance of the whole image and of columns x rows regions of nearly equal size, in the order of RegionMeans.
std::vector<double> luminance_means(const RgbImage& image, int columns, int rows);

/// A confidence interval for the ratio of two independent means. `ratio` is not finite where the reference is zero.
struct RatioInterval {
    double ratio = 1, low = 1, high = 1;

    bool within(double bound) const { return low >= 1 - bound && high <= 1 + bound; }
    bool excludes(double bound) const { return low > 1 + bound || high < 1 - bound; }
};

/// Two-sided interval of image / reference that misses the true ratio with probability `level` [Student's t with Welch's
/// degrees of freedom, to first order in the reference's error], and never narrower than what float pixels resolve. Two
/// zeros have ratio 1; against a zero reference the interval is [0, inf) if zero is within the image's own interval and
/// [inf, inf) otherwise.
RatioInterval ratio_interval(const Estimate& image, const Estimate& reference, double level);

}  // namespace lightloom
