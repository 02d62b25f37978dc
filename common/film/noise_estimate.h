#pragma once
// NoiseEstimate: an image's relMSE as its own groups of iterations show it, without a reference.

#include <cstddef>
#include <cstdint>
#include <functional>

#include "common/core/state_bytes.h"

namespace lightloom {

/// What the groups of an image tell of its error. It knows only what has been sampled: light that no sample has found yet is not
/// in it, and a rare, bright sample is not before it has come. It tends to be high where the samples of different groups are
/// stratified together, because the error of their mean then falls faster than the groups' spread promises.
struct NoiseEstimate {
    double relmse = 0;  ///< Estimate of Metrics::relmse.
    /// Standard error of `relmse`, from the spread between groups; every correlation between pixels is in it. For fewer than
    /// `kLeastGroups` groups it is what it would be if all pixels were wrong together and normally distributed.
    double error = 0;
    uint32_t groups = 0;      ///< From which the estimate was made.
    uint64_t iterations = 0;  ///< Of these groups.

    /// With fewer groups the spread between groups is itself noise.
    static constexpr uint32_t kLeastGroups = 8;
    /// Whether the image's error can be taken for no larger than `target`. The standard error is added, because the estimate is
    /// asked again and again and the first low one would be believed.
    bool reaches(double target) const { return groups >= kLeastGroups && relmse + error <= target; }
    /// Whether the estimate of a growing image is made when it has `groups` groups of `iterations` iterations in all, after it was
    /// made with `last` iterations: with 2, 4, 8, then with each group up to 20, then with each tenth more iterations. So decisions
    /// follow from the plan alone, and their cost stays small.
    static constexpr bool is_due(uint32_t groups, uint64_t iterations, uint64_t last) {
        if (groups < kLeastGroups) return groups == 2 || groups == 4;
        return groups <= 20 || iterations >= last + last / 10;
    }
    /// Added to the square of a pixel's value, as Metrics::relmse does.
    static constexpr double kEpsilon = 0.01;

    friend bool operator==(const NoiseEstimate&, const NoiseEstimate&) = default;
};

/// Mean and spread of a scalar that has one value per group after the first, all of the same expectation.
class GroupSpread {
  public:
    void add(double value);
    /// Standard error of the mean over these groups, relative to the mean.
    double relative_error() const;

    void write_state(StateWriter& out) const;
    void read_state(StateReader& in);

  private:
    uint32_t count_ = 0;
    double mean_ = 0, moment_ = 0;
};

/// Writes the means of a row, three channels interleaved.
using MeanOfRow = std::function<void(int y, double* values)>;
/// Mean over all values of V / (r^2 + epsilon), row-major and interleaved with three channels: V = `variance_factor` * moment is
/// the variance of a mean, and r what is known of the true value. The mean itself would not do as r: where few samples have found
/// the light, mean and V are large in the same pixels, and their ratio is at most about 1, whatever the error is. So r is the
/// mean after a local Wiener filter (5 x 5 pixels), which takes a pixel's neighbours into account as far as its own noise exceeds
/// the contrast around it [Lee 1980], or what the pixel shows by itself beyond three standard deviations, if that is more.
/// `mean` is asked once for each row, in ascending order.
double relative_variance(const MeanOfRow& mean, const double* moment, int width, int height, double variance_factor,
                         double epsilon);

}  // namespace lightloom
