// Where an image's light and an algorithm's noise come from: for emitter hits, next event, longer connections and light
// tracing, the share of the mean that the weights give to them, and the share of the variance per iteration (of single
// pixels, relative to their brightness, without the noisiest 0.1 %).
//
//   technique_shares SCENE [--algorithms bdpt,lvcbpt,spcbpt] [--iterations N] [--seeds N] [--resolution WxH]
//                    [--set key=value ...]

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <numeric>

#include "common/transport/bdpt.h"
#include "common/transport/lvcbpt.h"
#include "common/transport/spcbpt.h"
#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

namespace {

enum Class { kHits, kNextEvent, kConnections, kLightTracing, kClasses };
constexpr const char* kNames[kClasses] = {"emitter hits", "s = 1", "2 <= s < k", "light tracing"};

Class class_of(const PathContribution& c) {
    if (c.s == 0) return kHits;
    if (c.to_lens()) return kLightTracing;
    return c.s == 1 ? kNextEvent : kConnections;
}

/// One class of an algorithm with a cache, weighted as in the whole.
template <class Whole>
struct ClassOfCached {
    Whole whole;
    Class wanted;

    auto prepare(const UnitScope& scope, UnitPreparation* preparation) const {
        return whole.prepare(scope, preparation, [&](const PathContribution& c, const PathView& view, uint64_t, auto& chunk) {
            if (wanted != kLightTracing) return;
            const uint32_t pixel = uint32_t(scope.scene.frame().crop.index(int(c.film.x), int(c.film.y)));
            chunk.splats.push_back({pixel, scope.work.first_iteration, c.value * whole.weight(view, c.s)});
        });
    }
    Rgb sample(SampleContext& context, const typename Whole::State& state) const {
        Rgb sum;
        whole.trace(context, state, [&](const PathContribution& c, const PathView& view) {
            if (class_of(c) == wanted) sum += c.value * whole.weight(view, c.s);
        });
        return sum;
    }
};

struct ClassOfBdpt {
    BdptSelection selection;
    Class wanted;

    Rgb sample(SampleContext& context) const {
        Rgb sum;
        trace_bdpt_sample<ViewDetail::kFull>(
            context, [](const PathVertex*, int) {},
            [&](const PathContribution& c, const PathView& view) {
                if (class_of(c) != wanted) return;
                const Rgb weighted = c.value * float(mis_weight(view, {TechniqueKind::kConnect, c.s}, selection));
                if (c.to_lens())
                    context.splat(c.film, weighted);
                else
                    sum += weighted;
            });
        return sum;
    }
};

std::vector<double> image_of(const Partial& part, const Rect& crop) {
    std::vector<double> image(size_t(crop.area()), 0.0);
    for (size_t i = 0; i < image.size(); ++i)
        image[i] = (part.camera[3 * i] + part.camera[3 * i + 1] + part.camera[3 * i + 2]) / (3.0 * part.samples_per_pixel);
    for (const SplatSum& s : part.splats) image[s.pixel] += (s.rgb[0] + s.rgb[1] + s.rgb[2]) / (3.0 * double(part.light_paths));
    return image;
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
    const std::shared_ptr<const Scene>& scene = loaded.scene;
    const Rect crop = scene->frame().crop;

    for (const std::string& name : algorithms) {
        RenderSettings settings = bench::settings_of(name, set, loaded);
        const TransportParameters parameters = bench::value_or_exit(TransportParameters::read(settings));
        SubspaceTables tables;
        if (parameters.needs_tables) {
            TrainingReport report;
            tables = bench::value_or_exit(make_tables(*scene, settings, {}, &report));
        }
        const double frame_paths = parameters.light_paths * double(crop.area());
        std::vector<std::vector<std::vector<double>>> images(kClasses);
        for (int c = 0; c < kClasses; ++c) {
            for (uint32_t seed = 0; seed < seeds; ++seed) {
                settings.seed = 100 + seed;
                const uint64_t light_paths = uint64_t(frame_paths * iterations + 0.5);
                const UnitWork work{0, iterations, 0, crop, 0, std::max<uint64_t>(1, light_paths)};
                const auto render = [&](const auto& algorithm) {
                    return render_unit(algorithm, *scene, settings, parameters.roulette, work, {});
                };
                const Partial part = bench::value_or_exit([&]() -> Result<Partial> {
                    const Class wanted = Class(c);
                    if (name == "bdpt") return render(ClassOfBdpt{{frame_paths}, wanted});
                    if (name == "lvcbpt") {
                        const LvcbptAlgorithm<> whole{
                            {{frame_paths, parameters.connections / tables.vertices_per_path, TypicalSurvival(parameters.roulette)},
                             parameters.connections},
                            parameters.heuristic,
                            parameters.minimum_paths};
                        return render(ClassOfCached<LvcbptAlgorithm<>>{whole, wanted});
                    }
                    if (name != "spcbpt") return invalid_argument("no shares of techniques for '" + name + "'");
                    const auto whole = make_spcbpt(parameters, std::make_shared<const PreparedTables>(tables), frame_paths);
                    return render(ClassOfCached<SpcbptAlgorithm<>>{whole, wanted});
                }());
                images[size_t(c)].push_back(image_of(part, crop));
            }
        }
        const size_t pixels = size_t(crop.area());
        std::vector<double> mean(pixels, 0.0), light(kClasses, 0.0), noise(kClasses, 0.0);
        for (size_t c = 0; c < kClasses; ++c)
            for (const auto& image : images[c])
                for (size_t p = 0; p < pixels; ++p) mean[p] += image[p] / seeds, light[c] += image[p] / seeds;
        for (size_t c = 0; c < kClasses; ++c) {
            std::vector<double> variance(pixels);
            for (size_t p = 0; p < pixels; ++p) {
                double sum = 0, square = 0;
                for (const auto& image : images[c]) sum += image[p], square += image[p] * image[p];
                variance[p] = (square - sum * sum / seeds) / (seeds - 1) * iterations / (mean[p] * mean[p] + 1e-4);
            }
            std::sort(variance.begin(), variance.end());
            variance.resize(pixels - pixels / 1000);
            noise[c] = std::accumulate(variance.begin(), variance.end(), 0.0) / double(variance.size());
        }
        const double all_light = std::accumulate(light.begin(), light.end(), 0.0);
        const double all_noise = std::accumulate(noise.begin(), noise.end(), 0.0);
        std::printf("%s, %u x %u iterations: relative variance of a pixel per iteration %.3g\n", name.c_str(), seeds, iterations,
                    all_noise);
        std::printf("  %-14s %9s %9s\n", "", "light", "noise");
        for (size_t c = 0; c < kClasses; ++c)
            std::printf("  %-14s %8.2f%% %8.2f%%\n", kNames[c], 100 * light[c] / all_light, 100 * noise[c] / all_noise);
    }
}
