#pragma once
// Runs of estimators whose truth is known, without any rendering: every pixel is the mean of draws from a distribution.

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "common/metrics/metrics.h"
#include "common/metrics/stability.h"

namespace lightloom::testing {

using Generator = std::mt19937_64;
/// One sample of a pixel (counted row by row) of a grey image of kSize x kSize. Each run has a copy of its own.
using Draw = std::function<double(Generator&, int pixel)>;

struct SyntheticImage {
    static constexpr int kSize = 12;
    static constexpr int kRegions = 3;  ///< In each direction.

    static RgbImage of(const std::vector<double>& pixels) {
        RgbImage image{kSize, kSize, {}};
        for (const double p : pixels) image.pixels.insert(image.pixels.end(), 3, float(p));
        return image;
    }
    static RgbImage grey(double value) { return of(std::vector<double>(kSize * kSize, value)); }
};

/// A reference without noise.
inline StabilityReference exact_reference(const RgbImage& image) {
    StabilityReference reference{.regions = {}, .floor = 0};
    for (const double mean : luminance_means(image, SyntheticImage::kRegions, SyntheticImage::kRegions))
        reference.regions.push_back({mean, 0});
    return reference;
}

/// A run with checkpoints after 1, 2, 4, ... `iterations` samples per pixel; its errors drop the largest percent when trimmed.
inline StabilityRun synthetic_run(uint64_t seed, Draw draw, const RgbImage& reference, int iterations = 64) {
    Generator generator(seed);
    StabilityRun run{.seed = seed, .checkpoints = {}, .region_means = {}, .fireflies = {}, .chance = {}};
    std::vector<double> sums(SyntheticImage::kSize * SyntheticImage::kSize), means(sums.size());
    for (int n = 1; n <= iterations; ++n) {
        for (size_t p = 0; p < sums.size(); ++p) sums[p] += draw(generator, int(p));
        if ((n & (n - 1)) != 0) continue;
        for (size_t p = 0; p < sums.size(); ++p) means[p] = sums[p] / n;
        const RgbImage image = SyntheticImage::of(means);
        const Metrics metrics = *compute_pixel_metrics(image, reference, 1);
        run.checkpoints.push_back({double(n), metrics.relmse, metrics.relmse_trimmed, {}});
        if (std::isfinite(metrics.mean_ratio)) run.checkpoints.back().mean_ratio = metrics.mean_ratio;
        run.region_means = luminance_means(image, SyntheticImage::kRegions, SyntheticImage::kRegions);
        run.fireflies = find_fireflies(image, reference);
    }
    return run;
}

inline std::vector<StabilityRun> synthetic_runs(uint64_t first_seed, const Draw& draw, const RgbImage& reference, int seeds = 20,
                                                int iterations = 64) {
    std::vector<StabilityRun> runs;
    for (int i = 0; i < seeds; ++i) runs.push_back(synthetic_run(first_seed + uint64_t(i), draw, reference, iterations));
    return runs;
}

/// Samples of mean `mean`.
inline Draw normal_draw(double deviation, double mean = 1) {
    return [normal = std::normal_distribution<double>(mean, deviation)](Generator& g, int) mutable { return normal(g); };
}
inline Draw lognormal_draw(double sigma, double mean = 1) {
    return [=, normal = std::normal_distribution<double>(-0.5 * sigma * sigma, sigma)](Generator& g, int) mutable {
        return mean * std::exp(normal(g));
    };
}
/// Density ~ x^(-1 - alpha): no variance for alpha <= 2.
inline Draw pareto_draw(double alpha, double mean = 1) {
    return [=](Generator& g, int) {
        return mean * (alpha - 1) / alpha * std::pow(1 - std::uniform_real_distribution<double>()(g), -1 / alpha);
    };
}

}  // namespace lightloom::testing
