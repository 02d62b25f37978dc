#pragma once
// Renderings by the production loop that are judged as the runs of a benchmark are.

#include <functional>
#include <memory>
#include <vector>

#include "common/metrics/metrics.h"
#include "common/metrics/stability.h"
#include "tests/support/estimates.h"

namespace lightloom::testing {

/// Makes the image of some iterations of a seed; images of different iterations are independent.
using SliceOfSeed = std::function<std::vector<double>(uint64_t seed, uint64_t first_iteration, uint32_t iterations)>;

/// One group of the whole frame, with one light path per sample.
inline RenderUnit slice_unit(const Scene& scene, uint64_t first, uint32_t iterations, uint64_t light_paths_per_iteration) {
    RenderUnit unit = whole_frame(scene, iterations, light_paths_per_iteration);
    unit.first_iteration = unit.group_first_iteration = first;
    return unit;
}

template <class A>
SliceOfSeed algorithm_slice(std::shared_ptr<const Scene> scene, const A& algorithm, int max_depth) {
    return [=](uint64_t seed, uint64_t first, uint32_t iterations) {
        const Result<Partial> partial =
            render_unit(algorithm, *scene, seed, max_depth + 1, {},
                        slice_unit(*scene, first, iterations, uint64_t(scene->frame().crop.area())), {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        return develop(*partial, scene->frame().crop);
    };
}

/// A production algorithm. Every seed makes its own tables; consecutive calls with one seed share them.
inline SliceOfSeed catalog_slice(std::shared_ptr<const Scene> scene, const std::string& algorithm, int max_depth) {
    struct Last {
        uint64_t seed = ~uint64_t(0);
        std::unique_ptr<Renderer> renderer;
    };
    return [=, last = std::make_shared<Last>()](uint64_t seed, uint64_t first, uint32_t iterations) {
        const RenderSettings settings = settings_of(algorithm, with_small_training(algorithm, {}), seed, max_depth);
        if (last->seed != seed) {
            auto renderer = create_with_tables(scene, settings, {}, nullptr);
            if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
            *last = {seed, *std::move(renderer)};
        }
        RenderUnit unit =
            slice_unit(*scene, first, iterations, settings.algorithm.light_paths_per_iteration(scene->frame().crop.area()));
        unit.splats_only = !settings.algorithm.info().camera_samples;
        const Result<Partial> partial = last->renderer->render(unit, {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        return develop(*partial, scene->frame().crop);
    };
}

inline RgbImage grey_image(const std::vector<double>& pixels, const Rect& crop) {
    RgbImage image{crop.width(), crop.height(), {}};
    for (const double p : pixels) image.pixels.insert(image.pixels.end(), 3, float(p));
    return image;
}

/// An image from independent groups, whose scatter tells its errors.
struct JudgedReference {
    RgbImage image;
    StabilityReference judged;
};

inline JudgedReference reference_render(const SliceOfSeed& slice, const Rect& crop, int groups, uint32_t iterations_each) {
    const size_t pixels = size_t(crop.area());
    std::vector<WeightedMean> means(pixels);
    lightloom::RegionMeans regions(3, 3);
    for (int g = 0; g < groups; ++g) {
        const std::vector<double> image = slice(uint64_t(1) << 40, uint64_t(g) * iterations_each, iterations_each);
        for (size_t p = 0; p < pixels; ++p) means[p].add(image[p], 1);
        regions.add(grey_image(image, crop), 1);
    }
    std::vector<double> image;
    double floor = 0;
    for (const WeightedMean& mean : means) {
        const Estimate e = mean.estimate();
        image.push_back(e.mean);
        floor += e.variance / (e.mean * e.mean + 0.01) / double(pixels);
    }
    return {grey_image(image, crop), {.regions = regions.estimates(), .floor = floor}};
}

/// A run with checkpoints after 1, 2, 4, ... `iterations`.
inline StabilityRun judged_run(const SliceOfSeed& slice, uint64_t seed, const Rect& crop, const RgbImage& reference,
                               int iterations) {
    StabilityRun run{.seed = seed, .checkpoints = {}, .region_means = {}, .fireflies = {}, .chance = {}};
    std::vector<double> sum(size_t(crop.area())), mean(sum.size());
    for (int done = 0, n = 1; n <= iterations; done = n, n *= 2) {
        const std::vector<double> more = slice(seed, uint64_t(done), uint32_t(n - done));
        for (size_t p = 0; p < sum.size(); ++p) sum[p] += more[p] * (n - done), mean[p] = sum[p] / n;
        const RgbImage image = grey_image(mean, crop);
        const Metrics metrics = *compute_pixel_metrics(image, reference);
        run.checkpoints.push_back({double(n), metrics.relmse, metrics.relmse_trimmed, metrics.mean_ratio});
        run.region_means = luminance_means(image, 3, 3);
        run.fireflies = find_fireflies(image, reference);
    }
    return run;
}

/// Findings of many independent judgements.
struct JudgedRenders {
    int judged = 0, biased = 0, misses_light = 0, heavy_tail = 0, stalls = 0, sound = 0;
    Stability last;
};

inline JudgedRenders judge_renders(const SliceOfSeed& slice, const Rect& crop, const JudgedReference& reference, int judgements,
                                   int seeds, int iterations, const std::optional<ChanceLight>& chance = {}) {
    JudgedRenders all;
    for (int j = 0; j < judgements; ++j) {
        std::vector<StabilityRun> runs;
        for (int s = 0; s < seeds; ++s) {
            runs.push_back(judged_run(slice, uint64_t(j * seeds + s), crop, reference.image, iterations));
            runs.back().chance = chance;
        }
        const auto result = judge_stability(runs, reference.judged);
        if (!result.ok()) throw std::runtime_error(result.status().message());
        all.last = *result;
        all.judged += result->judged, all.biased += result->biased, all.misses_light += result->misses_light;
        all.heavy_tail += result->heavy_tail, all.stalls += result->stalls, all.sound += result->sound();
    }
    return all;
}

}  // namespace lightloom::testing
