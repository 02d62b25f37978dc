// Shows where an image's light and an algorithm's noise come from: for emitter hits, next event, longer connections,
// light tracing and merging, the share of the mean that they get by the weights, and the share of the variance per
// iteration (of single pixels, relative to their brightness, without the noisiest 0.1 %). Works for any algorithm of
// the catalog except those that do their own loops and show no single contributions.
//
//   technique_shares SCENE [--algorithms bdpt,lvcbpt,spcbpt] [--iterations N] [--seeds N] [--resolution WxH]
//                    [--set key=value ...]

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <numeric>

#include "common/core/fork_join.h"
#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

namespace {

enum Class { kHits, kOneLightVertex, kConnections, kLightTracing, kMerging, kClasses };
constexpr const char* kNames[kClasses] = {"emitter hits", "s = 1", "2 <= s < k", "light tracing", "merging"};

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

/// The contribution of each class to the image, one number per pixel.
using Images = std::vector<std::vector<double>>;

Images images_of(const Renderer& renderer, const Scene& scene, const RenderUnit& unit) {
    Images images(kClasses, std::vector<double>(size_t(scene.frame().crop.area()), 0.0));
    const auto see = [&](const SeenContribution& seen) {
        const Technique technique = seen.found.technique;
        const double samples = technique.splats() ? double(unit.light_path_count) : unit.samples_per_pixel();
        const Rgb& value = seen.found.value;
        const double weighted = seen.weight * (double(value.r) + double(value.g) + double(value.b)) / (3 * samples);
        if (std::isfinite(weighted)) images[class_of(technique)][seen.pixel] += weighted;
    };
    (void)bench::value_or_exit(renderer.watch(unit, see, {}));
    return images;
}

void report(const std::string& name, const std::vector<Images>& by_seed, uint32_t iterations) {
    const size_t seeds = by_seed.size(), pixels = by_seed[0][0].size();
    std::vector<double> mean(pixels, 0.0), light(kClasses, 0.0), noise(kClasses, 0.0);
    for (const Images& images : by_seed)
        for (size_t c = 0; c < kClasses; ++c)
            for (size_t p = 0; p < pixels; ++p) mean[p] += images[c][p] / double(seeds), light[c] += images[c][p] / double(seeds);
    const double all_light = std::accumulate(light.begin(), light.end(), 0.0);
    if (all_light == 0) {
        std::printf("%s: shows no contributions\n", name.c_str());
        return;
    }
    for (size_t c = 0; c < kClasses; ++c) {
        std::vector<double> variance(pixels);
        for (size_t p = 0; p < pixels; ++p) {
            double sum = 0, square = 0;
            for (const Images& images : by_seed) sum += images[c][p], square += images[c][p] * images[c][p];
            variance[p] = (square - sum * sum / double(seeds)) / double(seeds - 1) * iterations / (mean[p] * mean[p] + 1e-4);
        }
        std::sort(variance.begin(), variance.end());
        variance.resize(pixels - pixels / 1000);
        noise[c] = std::accumulate(variance.begin(), variance.end(), 0.0) / double(variance.size());
    }
    const double all_noise = std::accumulate(noise.begin(), noise.end(), 0.0);
    std::printf("%s, %zu x %u iterations: relative variance of a pixel per iteration %.3g\n", name.c_str(), seeds, iterations,
                all_noise);
    std::printf("  %-14s %9s %9s\n", "", "light", "noise");
    for (size_t c = 0; c < kClasses; ++c)
        std::printf("  %-14s %8.2f%% %8.2f%%\n", kNames[c], 100 * light[c] / all_light, 100 * noise[c] / all_noise);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Shares of techniques in an image's light and noise");
    std::string scene_path, resolution;
    std::vector<std::string> algorithms{"bdpt", "lvcbpt", "spcbpt"}, set;
    uint32_t iterations = 8, seeds = 8;
    app.add_option("scene", scene_path)->required();
    app.add_option("--algorithms", algorithms)->delimiter(',');
    app.add_option("--iterations", iterations);
    app.add_option("--seeds", seeds)->check(CLI::Range(2u, 1000u));
    app.add_option("--resolution", resolution);
    app.add_option("--set", set);
    CLI11_PARSE(app, argc, argv);

    const bench::LoadedScene loaded = bench::load(scene_path, resolution);
    for (const std::string& name : algorithms) {
        const RenderSettings settings = bench::settings_of(name, set, loaded);
        TrainingReport training;
        const Tables tables = bench::value_or_exit(make_tables(*loaded.scene, settings, {}, &training));
        const RenderUnit unit = bench::whole_frame(*loaded.scene, settings.algorithm, iterations);
        std::vector<Images> by_seed(seeds);
        // A renderer that is being watched uses one thread, so that seeds run in parallel.
        fork_join(seeds, [&](size_t first, size_t last) {
            for (size_t i = first; i < last; ++i) {
                RenderSettings own = settings;
                own.seed = 100 + i;
                const auto renderer = bench::value_or_exit(Renderer::create(loaded.scene, own, tables));
                by_seed[i] = images_of(*renderer, *loaded.scene, unit);
            }
        });
        report(name, by_seed, iterations);
    }
}
