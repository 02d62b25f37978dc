#include "common/metrics/stability.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "common/core/vec.h"
#include "common/metrics/significance.h"
#include "common/metrics/stability_verdict.h"

namespace lightloom {

namespace {

/// A slope is called too flat only if it is flatter than this with certainty. Logarithms of errors that vary between seeds fall a
/// little more slowly than the errors' mean does: by half of their relative variance. The margin covers that up to a variation of
/// 0.5 at the first checkpoint.
constexpr double kFlatSlope = -0.45;
/// Errors that vary so much between seeds, relative to their mean, have a heavy tail. Where they follow a lognormal distribution of
/// a third of that variation, three or more seeds show so much with a probability far below 0.1 %.
constexpr double kHeavyVariation = 0.75;
/// Above either of these a slope that is too flat comes from outliers.
constexpr double kOutlierVariation = 0.25, kOutlierConcentration = 0.25;
/// Slopes are fitted over the last factor of 16 in iterations; they need a factor of 4.
constexpr double kSlopeWindow = 16, kLeastSlopeRange = 4;
/// A checkpoint counts for the slope where the error is expected to be so many times the reference's own.
constexpr double kAboveFloor = 3;
/// The mean over the seeds may lack so many outliers as large as the largest one that was seen.
constexpr double kMissingOutliers = 10;
/// A bias that is known no better than this is not known.
constexpr double kKnownBias = 0.5;

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const size_t middle = values.size() / 2;
    return values.size() % 2 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

SeedMean mean_of(const std::vector<double>& values) {
    SeedMean result{.count = int(values.size())};
    for (const double v : values) result.mean += v / double(values.size());
    if (values.size() < 2) return result;
    double moment = 0;
    for (const double v : values) moment += (v - result.mean) * (v - result.mean);
    result.error = std::sqrt(moment / (double(values.size()) * double(values.size() - 1)));
    return result;
}

template <class Get>
std::vector<double> of_each(std::span<const StabilityRun> runs, Get get) {
    std::vector<double> values;
    for (const StabilityRun& run : runs) values.push_back(get(run));
    return values;
}

Status check_runs(std::span<const StabilityRun> runs, const StabilityReference& reference) {
    const auto finite = [](double v) { return std::isfinite(v); };
    const auto positive = [](double v) { return v >= 0 && std::isfinite(v); };
    if (runs.empty()) return invalid_argument("stability: there are no runs to judge");
    if (reference.floor && !positive(*reference.floor)) return invalid_argument("stability: the reference's floor is no error");
    for (const Estimate& e : reference.regions)
        if (!finite(e.mean) || !(e.variance >= 0)) return invalid_argument("stability: a mean of the reference is not a number");
    std::set<uint64_t> seeds;
    for (const StabilityRun& run : runs) {
        const auto wrong = [&](const std::string& what) {
            return invalid_argument("stability: seed " + std::to_string(run.seed) + ": " + what);
        };
        if (!seeds.insert(run.seed).second) return wrong("occurs twice; runs need seeds of their own");
        if (run.checkpoints.empty()) return wrong("has no checkpoints");
        if (run.region_means.size() != reference.regions.size())
            return wrong("has " + std::to_string(run.region_means.size()) + " region means, the reference has " +
                         std::to_string(reference.regions.size()));
        if (!std::all_of(run.region_means.begin(), run.region_means.end(), finite)) return wrong("a region's mean is not finite");
        if (!positive(run.fireflies.energy)) return wrong("the energy of fireflies is not a positive number");
        double before = 0;
        for (const StabilityCheckpoint& c : run.checkpoints) {
            if (!(c.iterations > before) || !finite(c.iterations)) return wrong("iterations of checkpoints do not ascend from 1");
            if (!positive(c.relmse) || !positive(c.relmse_trimmed)) return wrong("an error is not a positive number");
            if (c.mean_ratio && !finite(*c.mean_ratio)) return wrong("a ratio of means is not finite");
            before = c.iterations;
        }
        if (const auto& c = run.chance; c && !(positive(c->share) && positive(c->unreachable_share) && positive(c->expected_hits)))
            return wrong("the estimate of rare light is not made of positive numbers");
    }
    if (reference.regions.empty()) return invalid_argument("stability: the reference has no means");
    return {};
}

/// Slope of log RMSE over log iterations by least squares, over the checkpoints in [from, to].
std::optional<double> slope_of(const StabilityRun& run, double floor, double from, double to) {
    std::vector<std::pair<double, double>> points;
    for (const StabilityCheckpoint& c : run.checkpoints) {
        if (c.iterations < from || c.iterations > to) continue;
        // The expected error is well above the floor, so that one below is a rare accident.
        const double error = std::max(c.relmse - floor, floor);
        if (error > 0) points.emplace_back(std::log(c.iterations), 0.5 * std::log(error));
    }
    if (points.size() < 3 || points.back().first - points.front().first < 0.999 * std::log(kLeastSlopeRange)) return {};
    double mx = 0, my = 0, xx = 0, xy = 0;
    for (const auto& [x, y] : points) mx += x / double(points.size()), my += y / double(points.size());
    for (const auto& [x, y] : points) xx += (x - mx) * (x - mx), xy += (x - mx) * (y - my);
    return xy / xx;
}

/// Slopes of the runs that have one; empty where the reference does not allow for that. Which checkpoints count is decided by all
/// runs together: each run's own errors would choose those that are too large by chance.
std::vector<double> slopes_of(std::span<const StabilityRun> runs, const std::optional<double>& floor) {
    if (!floor) return {};
    const double scale = mean_of(of_each(runs, [&](const StabilityRun& run) {
                             const StabilityCheckpoint& end = run.checkpoints.back();
                             return (end.relmse - *floor) * end.iterations;
                         })).mean;
    if (!(scale > 0)) return {};
    const double limit = *floor > 0 ? scale / (kAboveFloor * *floor) : HUGE_VAL;
    std::vector<double> slopes;
    for (const StabilityRun& run : runs) {
        const double to = std::min(run.checkpoints.back().iterations, limit);
        if (const auto slope = slope_of(run, *floor, to / kSlopeWindow, to)) slopes.push_back(*slope);
    }
    if (2 * slopes.size() < runs.size()) slopes.clear();
    return slopes;
}

/// Whether the mean is above `bound`: Student's one-sided test.
bool is_above(const SeedMean& mean, double bound, double level) {
    if (mean.count < 2 || !(mean.mean > bound)) return false;
    return mean.error == 0 || student_p_value((mean.mean - bound) / mean.error, mean.count - 1) / 2 < level;
}

/// Interval of a region's ratio. Means of seeds have long upper tails: as long as the outliers have not landed, the mean is too
/// dark and its variance too small. Its upper end therefore allows for outliers that the runs lack.
RatioInterval interval_of(const std::vector<double>& means, Estimate reference, double level) {
    WeightedMean mean;
    // A variance from few seeds, small by chance, would otherwise borrow the certainty of the reference's.
    reference.degrees = std::min(reference.degrees, std::max(1.0, double(means.size()) - 1));
    if (int(means.size()) >= kSeedsForBias)
        for (const double m : means) mean.add(m, 1);
    else
        mean.add(mean_of(means).mean, 1);  // of unknown variance
    RatioInterval interval = ratio_interval(mean.estimate(), reference, level);
    if (reference.mean > 0) {
        const double outlier = *std::max_element(means.begin(), means.end()) - median(means);
        interval.high += kMissingOutliers * outlier / (double(means.size()) * reference.mean);
    }
    return interval;
}

double score(const RatioInterval& interval) {
    if (std::isinf(interval.low) && interval.low < 0) return 0;  // unknown
    if (!std::isfinite(interval.ratio)) return interval.low > 0 ? HUGE_VAL : 0;
    const double width = interval.high - interval.low;
    return width > 0 ? std::fabs(interval.ratio - 1) / width : 0;
}

void measure_errors(std::span<const StabilityRun> runs, const StabilityReference& reference, Stability* result) {
    const std::vector<double> errors = of_each(runs, [](const StabilityRun& run) { return run.checkpoints.back().relmse; });
    const auto [least, most] = std::minmax_element(errors.begin(), errors.end());
    const SeedMean raw = mean_of(errors);
    result->seeds = int(runs.size());
    result->error = raw;
    result->error.mean -= reference.floor.value_or(0);
    if (raw.mean > 0) {
        result->variation = raw.error * std::sqrt(double(runs.size())) / raw.mean;
        result->spread = *most / *least;
        result->worst_seed_share = *most / (raw.mean * double(runs.size()));
    }
    result->worst_seed = runs[size_t(most - errors.begin())].seed;
    result->concentration = median(of_each(runs, [](const StabilityRun& run) {
        const StabilityCheckpoint& end = run.checkpoints.back();
        return end.relmse > 0 ? std::max(0.0, 1 - end.relmse_trimmed / end.relmse) : 0;
    }));
    size_t steps = 0, rising = 0;
    for (const StabilityRun& run : runs)
        for (size_t i = 1; i < run.checkpoints.size(); ++i, ++steps)
            rising += run.checkpoints[i].relmse > run.checkpoints[i - 1].relmse;
    if (steps > 0) result->rising = double(rising) / double(steps);
    result->firefly_count = mean_of(of_each(runs, [](const StabilityRun& run) { return double(run.fireflies.count); }));
    result->firefly_energy = mean_of(of_each(runs, [](const StabilityRun& run) { return run.fireflies.energy; }));
}

void measure_tiny(std::span<const StabilityRun> runs, TinyBudget* tiny) {
    tiny->iterations = median(of_each(runs, [](const StabilityRun& run) { return run.checkpoints.front().iterations; }));
    tiny->relmse = mean_of(of_each(runs, [](const StabilityRun& run) { return run.checkpoints.front().relmse; }));
    std::vector<double> ratios;
    for (const StabilityRun& run : runs)
        if (const auto& ratio = run.checkpoints.front().mean_ratio) ratios.push_back(*ratio);
    if (ratios.empty()) return;
    tiny->mean_ratio = mean_of(ratios);
    tiny->least_mean_ratio = *std::min_element(ratios.begin(), ratios.end());
}

void judge_tail(std::span<const StabilityRun> runs, const StabilityReference& reference, double level, Stability* result) {
    const std::vector<double> slopes = slopes_of(runs, reference.floor);
    if (!slopes.empty()) result->slope = mean_of(slopes);
    const bool flat = result->slope && is_above(*result->slope, kFlatSlope, level);
    const bool outliers = result->variation > kOutlierVariation || result->concentration > kOutlierConcentration;
    result->heavy_tail = (result->seeds > 2 && result->variation > kHeavyVariation) || (flat && outliers);
    result->stalls = flat && !outliers;
    const bool visible = result->firefly_count.mean >= 1 && result->concentration >= 0.5;
    result->has_fireflies = result->firefly_energy.mean >= 0.01 || visible;
    result->no_better_than_black = result->error.mean >= 1;
}

}  // namespace

Fireflies find_fireflies(const RgbImage& image, const RgbImage& reference, double factor) {
    const auto luminance = [](const RgbImage& of, size_t pixel) {
        const float* p = &of.pixels[3 * pixel];
        return double(Rgb(p[0], p[1], p[2]).luminance());
    };
    const size_t pixels = reference.pixels.size() / 3;
    double light = 0;
    for (size_t i = 0; i < pixels; ++i) light += luminance(reference, i);
    Fireflies found;
    if (!(light > 0)) return found;
    const double least = 0.1 * light / double(pixels);
    for (size_t i = 0; i < pixels; ++i) {
        const double x = luminance(image, i), r = luminance(reference, i);
        if (!(x > factor * std::max(r, least))) continue;
        ++found.count;
        found.energy += (x - r) / light;
    }
    return found;
}

Result<Stability> judge_stability(std::span<const StabilityRun> runs, const StabilityReference& reference, double level) {
    LL_RETURN_IF_ERROR(check_runs(runs, reference));
    Stability result;
    measure_errors(runs, reference, &result);
    measure_tiny(runs, &result.tiny);
    judge_tail(runs, reference, level, &result);

    const double each = sidak(level, int(reference.regions.size()));
    for (size_t r = 0; r < reference.regions.size(); ++r) {
        const std::vector<double> means = of_each(runs, [&](const StabilityRun& run) { return run.region_means[r]; });
        result.regions.push_back(interval_of(means, reference.regions[r], each));
    }
    const auto worse = [](const RatioInterval& a, const RatioInterval& b) { return score(a) < score(b); };
    result.worst_region = size_t(std::max_element(result.regions.begin(), result.regions.end(), worse) - result.regions.begin());
    const RatioInterval& whole = result.regions[0];
    const double bound = std::max(1 - whole.low, whole.high - 1);
    if (std::isfinite(bound)) result.bias_bound = bound;
    explain_bias(runs, reference, &result);
    if (result.biased || result.misses_light) result.stalls = false;  // for a known reason
    // An excess or a deficit that is proved is known well enough, however wide its interval is.
    result.judged = result.biased || result.misses_light || (result.bias_bound && *result.bias_bound <= kKnownBias);
    result.verdict = verdict_of(result, runs, reference);
    return result;
}

}  // namespace lightloom
