#pragma once
// How reliably an algorithm renders a scene: what many short runs with different seeds show that one error curve hides. An
// estimator of finite variance brings its error down as n^-1/2 in every run. One with heavy tails looks converged until a firefly
// lands. One that misses light agrees with itself and not with the reference. README.md explains how the verdicts are reached.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/film/frame.h"
#include "common/metrics/region_means.h"

namespace lightloom {

/// Pixels of a run that shine where the reference does not.
struct Fireflies {
    uint64_t count = 0;
    double energy = 0;  ///< What they have above the reference, as a share of the reference's light.
};

/// The pixels whose luminance exceeds `factor` times the larger one of the reference's and a tenth of the reference's mean. The
/// latter stands for black pixels, in which otherwise any light would be a firefly. The images are of equal size; a black reference
/// has none.
Fireflies find_fireflies(const RgbImage& image, const RgbImage& reference, double factor = 10);

/// Errors of a run against the reference after so many iterations, as in Metrics.
struct StabilityCheckpoint {
    double iterations = 0;
    double relmse = 0, relmse_trimmed = 0;
    std::optional<double> mean_ratio;  ///< Of the image to the reference.
};

/// What RareLightReport says of one run: relative to the light of the image.
struct ChanceLight {
    double share = 0;              ///< Found by chance hits alone.
    double unreachable_share = 0;  ///< Never found.
    double expected_hits = 0;      ///< Effective number of samples in this run that are expected to have found it.
};

/// One seed.
struct StabilityRun {
    uint64_t seed = 0;
    std::vector<StabilityCheckpoint> checkpoints;  ///< At least one, by ascending iterations.
    std::vector<double> region_means;              ///< luminance_means() of the last image: the whole, then the regions.
    Fireflies fireflies;                           ///< Of the last image.
    std::optional<ChanceLight> chance;
};

/// What the runs are compared with.
struct StabilityReference {
    /// Of the same regions. An infinite variance stands for one that nobody knows; such a region is not judged.
    std::vector<Estimate> regions;
    /// relMSE that the reference's own variance adds to every error. Without it the slope is not judged.
    std::optional<double> floor;
};

/// A number with its standard error over the seeds; 0 for one seed.
struct SeedMean {
    double mean = 0, error = 0;
    int count = 0;
};

/// What the smallest checkpoint shows, at a budget that is far too small.
struct TinyBudget {
    double iterations = 0;  ///< Median over the seeds.
    SeedMean relmse;
    SeedMean mean_ratio;          ///< count is 0 where no run tells.
    double least_mean_ratio = 1;  ///< The darkest seed's.
};

/// Judgement over all runs of one algorithm on one scene with one budget.
struct Stability {
    int seeds = 0;
    SeedMean error;               ///< relMSE at the end, less the reference's own share where that is known.
    double variation = 0;         ///< Standard deviation over the seeds of relMSE at the end, relative to its mean.
    double spread = 1;            ///< Largest over smallest relMSE at the end; infinite where the smallest is 0.
    uint64_t worst_seed = 0;      ///< The one of the largest.
    double worst_seed_share = 0;  ///< Its part of the sum of relMSE over the seeds.
    /// Median over the seeds: part of relMSE at the end that lies in the terms that relmse_trimmed drops.
    double concentration = 0;
    std::optional<SeedMean> slope;  ///< Of log RMSE over log iterations: -1/2 where the variance is finite.
    double rising = 0;              ///< Share of the steps between checkpoints at which the error rises.
    SeedMean firefly_count, firefly_energy;
    /// Image over reference, simultaneous at the level: the whole, then the regions. The upper ends allow for outliers that have
    /// not landed yet.
    std::vector<RatioInterval> regions;
    size_t worst_region = 0;           ///< Of `regions`: the one whose ratio is farthest from 1 in units of its interval's width.
    std::optional<double> bias_bound;  ///< Largest relative bias of the whole image that its interval holds.
    TinyBudget tiny;

    // The findings, each of which has its clause in the verdict.
    bool judged = false;         ///< The interval of the whole image is narrow enough to say something: bias_bound is at most 1/2.
    bool finds_nothing = false;  ///< Less than half of the light.
    bool biased = false;         ///< A mean is wrong, and chance does not explain it.
    bool misses_light = false;   ///< Too dark, but so much light is never found or only by rare hits: chance, or known in advance.
    bool heavy_tail = false;     ///< Outliers: the error falls more slowly than n^-1/2, or differs far between seeds.
    bool stalls = false;         ///< The error falls more slowly than n^-1/2, for no reason that is known.
    bool has_fireflies = false;  ///< They have at least 1 % of the light, or are there and most of the error lies in few pixels.
    bool no_better_than_black = false;  ///< relMSE is at least 1, which a black image stays below.

    bool sound() const;  ///< Judged and without any finding.
    /// Names of the findings for programs, as "biased" or "misses-light"; "not-judged" where `judged` is false.
    std::vector<std::string> flags() const;
    /// In plain words: clauses separated by "; ", the worst one first.
    std::string verdict;
};

/// Probability with which judge_stability() may accuse a sound algorithm of bias, over all regions together, and, separately, of a
/// heavy tail.
inline constexpr double kStabilityLevel = 1e-3;

/// Fewer seeds do not tell their own scatter well enough to convict anything of bias.
inline constexpr int kSeedsForBias = 5;

/// Judges at least one run; from one run alone nothing follows but its errors. kInvalidArgument names what is wrong: no runs, a run
/// without checkpoints or with a number that is not finite, iterations that do not ascend, numbers of regions that differ, a seed
/// that occurs twice.
Result<Stability> judge_stability(std::span<const StabilityRun> runs, const StabilityReference& reference,
                                  double level = kStabilityLevel);

/// Name of a region of a grid of 3 x 3 in the order of luminance_means(): "the whole image", "the upper left", ...; of any other
/// number of regions "region 4".
std::string region_name(size_t index, size_t count);

}  // namespace lightloom
