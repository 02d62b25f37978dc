#pragma once
// Accumulation: the exact sum of the partials of complete full-frame groups, and the image that is developed from it.
//
// Sums are 128-bit integers with step 2^-44 (range about 1e25 radiance units), so that their order does not matter and
// merging is exact. The sums are not divided before develop(). One Accumulation holds one job with one set of
// parameters. Per pixel, camera sums, splat sums and second moments take 24 bytes each, from their first addition on; a
// GroupSum takes the same for its camera and splat sums.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/result.h"
#include "common/film/fixed_sums.h"
#include "common/film/noise_estimate.h"
#include "common/film/partial.h"
#include "common/film/response.h"

namespace lightloom {

/// Linear RGB float image, row-major, interleaved, of the crop window.
struct RgbImage {
    int width = 0, height = 0;
    std::vector<float> pixels;  ///< 3 * width * height
};

/// The sums of one group that is not complete yet. Partials may be added in any order.
class GroupSum {
  public:
    /// Takes no memory before the first partial.
    explicit GroupSum(const FrameLayout& frame);
    /// kDataLoss if the partial does not fit the frame, holds a non-finite value, or exceeds the range; then nothing
    /// was added. The caller makes sure that each unit is added exactly once (by its key).
    Status add(const Partial& partial);
    /// Forgets what was added, and keeps the memory for the next group.
    void clear();

  private:
    friend class Accumulation;
    struct Tile {
        Rect pixels;
        uint32_t samples_per_pixel = 0;
    };
    /// Whether every pixel has `count` camera samples; if not, the first pixel that has another number, and that number.
    struct WrongCount {
        size_t pixel = 0;
        uint64_t count = 0;
    };
    std::optional<WrongCount> find_wrong_count(uint64_t count) const;
    uint64_t camera_count(size_t pixel) const;

    FrameLayout frame_;
    FixedSums camera_, splat_;  // 3 per pixel of the crop
    std::vector<Tile> tiles_;   // of the partials: how many samples a pixel has
    uint64_t light_paths_ = 0;
    uint64_t dropped_ = 0;
    double camera_bound_ = 0, splat_bound_ = 0;  // Sums of the partials' largest magnitudes, which bound every sum.
};

/// The exact sums of a job's complete groups.
class Accumulation {
  public:
    explicit Accumulation(const FrameLayout& frame, const FilmResponse& response = {});

    /// Folds a complete group of `iterations` iterations in. Groups are folded in ascending order of their index (the
    /// caller holds later ones back), because the second moments are kept in double. All groups have the same number of light
    /// paths per iteration. kFailedPrecondition, and nothing is folded, if the group is of another frame or does not hold
    /// `iterations` camera samples in every pixel (or none in any, for a group that only splats); kDataLoss if a sum would leave
    /// the range.
    Status fold(const GroupSum& group, uint32_t iterations);

    uint32_t group_count() const { return group_count_; }
    uint64_t iterations() const { return iterations_; }
    uint64_t dropped() const { return dropped_; }

    /// camera sum / camera count + splat sum / light paths, per pixel, after the film's response.
    RgbImage develop() const;
    /// Variance of each developed pixel and channel, from the second moments of whole group images (never of single
    /// samples, which share light paths): sum_g n_g (X_g - mean)^2 / ((G - 1) sum n_g). Empty for fewer than two
    /// groups, from which no variance can be estimated.
    RgbImage variance() const;
    /// The developed image's error as its groups show it; nothing for fewer than two groups. Takes some 20 ns per pixel.
    std::optional<NoiseEstimate> noise() const;
    /// Do the same for `count` pixels from `first` on, in row-major order, and write 3 * count values. A variance needs two groups
    /// at least.
    void develop(size_t first, size_t count, float* values) const;
    void variance(size_t first, size_t count, float* values) const;

    /// Appends all that later groups and images depend on, some 24 bytes for each of a pixel's arrays of sums.
    void write_state(std::string& out) const;
    /// Takes the place of an empty accumulation of the same frame and response. The reader has failed, and this is good for nothing
    /// any more, unless the bytes are those of such an accumulation.
    void read_state(StateReader& in);

  private:
    /// NoiseEstimate::kEpsilon for values before exposure.
    double epsilon() const { return NoiseEstimate::kEpsilon / (response_.exposure * response_.exposure); }

    FrameLayout frame_;
    FilmResponse response_;
    FixedSums camera_, splat_;
    uint64_t camera_count_ = 0;  // in every pixel
    uint64_t light_paths_ = 0;
    uint64_t dropped_ = 0;
    uint64_t iterations_ = 0;
    uint32_t group_count_ = 0;
    double camera_bound_ = 0, splat_bound_ = 0;
    // sum_g n_g (X_g - mean)^2, updated as groups come [West 1979], 3 per pixel. X_g are the groups' images after white balance and
    // before exposure: white balance mixes channels, and variances alone could not follow it. Their mean with weights n_g need not
    // be kept: it is that of the sums.
    std::vector<double> moment_;
    /// Of the relative squared distance between each group and those before it, as a mean over the frame.
    GroupSpread spread_;
};

}  // namespace lightloom
