#include "client/bench/technique_shares.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "common/core/fork_join.h"
#include "common/transport/renderer.h"

namespace lightloom::client {
namespace {

enum Class { kHits, kOneLightVertex, kConnections, kLightTracing, kMerging, kClasses };
constexpr std::string_view kNames[kClasses] = {"emitter hits", "s = 1", "2 <= s < k", "light tracing", "merging"};
/// Added to squared means, so that dark pixels do not decide.
constexpr double kDark = 1e-4;

Class class_of(Technique t) {
    switch (t.kind) {
        case TechniqueKind::kHit: return kHits;
        case TechniqueKind::kNextEvent: return kOneLightVertex;
        case TechniqueKind::kConnect: return t.s == 1 ? kOneLightVertex : kConnections;
        case TechniqueKind::kLens: return kLightTracing;
        case TechniqueKind::kMerge: return kMerging;
    }
    return kHits;
}

using Pixels = std::vector<double>;

/// What each class gives to the image of one seed, and whether anything lit the image at all.
struct Rendering {
    std::array<Pixels, kClasses> images;
    uint64_t contributions = 0;
    bool dark = true;
    Status status;
};

/// The whole frame, with as many light paths as a plan gives it.
RenderUnit whole_frame(const Scene& scene, const AlgorithmSettings& algorithm, uint32_t iterations) {
    const Rect& crop = scene.frame().crop;
    return {.iteration_count = iterations,
            .tile = crop,
            .light_path_count = iterations * algorithm.light_paths_per_iteration(crop.area()),
            .splats_only = !algorithm.info().camera_samples};
}

Rendering render(std::shared_ptr<const Scene> scene, const RenderSettings& settings, const Tables& tables, const RenderUnit& unit,
                 const std::stop_token& stop) {
    Rendering out;
    out.images.fill(Pixels(size_t(unit.tile.area()), 0.0));
    const Result<std::unique_ptr<Renderer>> renderer = Renderer::create(std::move(scene), settings, tables);
    if (!renderer.ok()) {
        out.status = renderer.status();
        return out;
    }
    const auto see = [&](const SeenContribution& seen) {
        ++out.contributions;
        const Technique technique = seen.found.technique;
        const double samples = technique.splats() || unit.splats_only ? double(unit.light_path_count) : unit.samples_per_pixel();
        const Rgb& value = seen.found.value;
        const double weighted = seen.weight * (double(value.r) + double(value.g) + double(value.b)) / (3 * samples);
        // The renderer drops what is not finite from the image as well, and counts it.
        if (std::isfinite(weighted)) out.images[class_of(technique)][seen.pixel] += weighted;
    };
    const Result<Partial> partial = (*renderer)->watch(unit, see, stop);
    out.status = partial.status();
    if (partial.ok())
        out.dark =
            partial->splats.empty() && std::all_of(partial->camera.begin(), partial->camera.end(), [](double v) { return v == 0; });
    return out;
}

/// Sums over seeds of the classes' images and of their squares.
struct Sums {
    std::array<Pixels, kClasses> value, square;
    uint64_t contributions = 0;
    bool dark = true;

    explicit Sums(size_t pixels) {
        value.fill(Pixels(pixels, 0.0));
        square.fill(Pixels(pixels, 0.0));
    }
    void add(const Rendering& rendering) {
        contributions += rendering.contributions;
        dark = dark && rendering.dark;
        for (size_t c = 0; c < kClasses; ++c) {
            for (size_t p = 0; p < value[c].size(); ++p) {
                const double x = rendering.images[c][p];
                value[c][p] += x;
                square[c][p] += x * x;
            }
        }
    }
};

TechniqueShares shares_of(const Sums& sums, uint32_t iterations, uint32_t seeds) {
    const size_t pixels = sums.value[0].size();
    const double n = seeds;
    Pixels mean(pixels, 0.0);
    for (const Pixels& value : sums.value)
        for (size_t p = 0; p < pixels; ++p) mean[p] += value[p] / n;
    TechniqueShares shares{.iterations = iterations, .seeds = seeds};
    double all_light = 0;
    for (size_t c = 0; c < kClasses; ++c) {
        Pixels variance(pixels);
        for (size_t p = 0; p < pixels; ++p) {
            const double spread = std::max(0.0, sums.square[c][p] - sums.value[c][p] * sums.value[c][p] / n) / (n - 1);
            variance[p] = spread * iterations / (mean[p] * mean[p] + kDark);
        }
        std::sort(variance.begin(), variance.end());
        variance.resize(pixels - pixels / 1000);
        const double light = std::accumulate(sums.value[c].begin(), sums.value[c].end(), 0.0);
        const double noise = std::accumulate(variance.begin(), variance.end(), 0.0) / double(variance.size());
        shares.classes.push_back({kNames[c], light, noise});
        all_light += light;
        shares.relative_variance += noise;
    }
    for (TechniqueShare& share : shares.classes) {
        share.light /= all_light;
        if (shares.relative_variance > 0) share.noise /= shares.relative_variance;
    }
    return shares;
}

}  // namespace

Result<TechniqueShares> technique_shares(std::shared_ptr<const Scene> scene, const RenderSettings& settings, const Tables& tables,
                                         uint32_t iterations, uint32_t seeds, std::stop_token stop) {
    if (iterations == 0) return invalid_argument("shares of techniques need at least one iteration");
    if (seeds < 2) return invalid_argument("shares of techniques need at least two seeds, between which noise shows");
    const RenderUnit unit = whole_frame(*scene, settings.algorithm, iterations);
    Sums sums(size_t(unit.tile.area()));
    // A renderer that is watched uses one thread, so that seeds run in parallel. They are added in their order, so that the
    // sums do not depend on the number of threads, and there are never more images than threads.
    const uint32_t batch = uint32_t(std::max(1, tbb::this_task_arena::max_concurrency()));
    for (uint32_t begin = 0; begin < seeds; begin += batch) {
        std::vector<Rendering> renderings(std::min(batch, seeds - begin));
        fork_join(renderings.size(), [&](size_t first, size_t last) {
            for (size_t i = first; i < last; ++i) {
                RenderSettings own = settings;
                own.seed += begin + i;
                renderings[i] = render(scene, own, tables, unit, stop);
            }
        });
        for (const Rendering& rendering : renderings) {
            LL_RETURN_IF_ERROR(rendering.status);
            sums.add(rendering);
        }
    }
    if (sums.contributions == 0 && !sums.dark)
        return invalid_argument("algorithm '" + settings.algorithm.name() +
                                "' does its own loops and shows no single contributions, of which shares are made");
    const bool found = std::any_of(sums.value.begin(), sums.value.end(), [](const Pixels& value) {
        return std::any_of(value.begin(), value.end(), [](double v) { return v != 0; });
    });
    if (!found)
        return failed_precondition("algorithm '" + settings.algorithm.name() + "' found no light in " + std::to_string(seeds) +
                                   " x " + std::to_string(iterations) + " iterations, so that there is nothing to share");
    return shares_of(sums, iterations, seeds);
}

}  // namespace lightloom::client
