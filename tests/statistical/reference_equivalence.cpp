// Equivalence of image means with an independent renderer's references: renders every scene that has one with each
// algorithm and reports confidence intervals of the ratio of mean luminances, for the whole image and a 3 x 3 grid.
//
//   reference_equivalence SHARED_DIR [--only house,door] [--algorithms path,bdpt] [--seconds 60] [--json OUT.jsonl]
//
// SHARED_DIR holds scenes/NAME/scene.pbrt, refs/NAME.exr and refs/refs.json. The intervals are two-sided at 95 %,
// Sidak-corrected over all scenes and algorithms (and regions), from the spread of independent group images, and include the
// reference's own relative standard error (three times that for a region, which has a ninth of the pixels). Rendering of a
// scene ends when its interval lies within the bound or after --seconds. Exit code 1 if some interval excludes the bound
// altogether: then the means differ.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/core/distributions.h"
#include "common/film/accumulation.h"
#include "common/film/exr_io.h"
#include "common/film/metrics.h"
#include "common/film/png.h"
#include "common/film/region_means.h"
#include "common/import/import.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"

using namespace lightloom;

namespace {

struct Options {
    std::string shared, json, pictures;
    std::vector<std::string> only, algorithms{"path", "bdpt"};
    double seconds = 60, bound = 0.01, region_bound = 0.05;
    uint64_t seed = 1;
};

nlohmann::ordered_json to_json(const RatioInterval& i) { return {{"ratio", i.ratio}, {"low", i.low}, {"high", i.high}}; }

struct Outcome {
    RatioInterval image, regions[9];
    uint64_t iterations = 0, dropped = 0;
    double seconds = 0;
};

Result<Outcome> compare_means(const Options& options, const std::string& name, const nlohmann::json& entry,
                              const std::string& algorithm, size_t tests) {
    auto imported = import_pbrt(options.shared + "/scenes/" + name + "/scene.pbrt");
    if (!imported.ok()) return imported.status();
    SceneOptions scene_options;
    const std::string resolution = entry.at("resolution");
    if (std::sscanf(resolution.c_str(), "%dx%d", &scene_options.width, &scene_options.height) != 2)
        return invalid_argument(name + ": no resolution in refs.json");
    RenderSettings settings;
    settings.algorithm = algorithm;
    settings.max_depth = imported->description.max_depth;
    settings.seed = options.seed;
    const float exposure = imported->description.film.exposure_scale;
    auto built = Scene::build(std::move(imported->description), scene_options);
    if (!built.ok()) return built.status();
    const std::shared_ptr<const Scene> scene = std::move(built).value();
    auto renderer = create_with_tables(scene, settings, {});
    if (!renderer.ok()) return renderer.status();
    auto reference = read_exr(options.shared + "/refs/" + name + ".exr");
    if (!reference.ok()) return reference.status();
    const FrameLayout frame = scene->frame();
    if (reference->color.width != frame.crop.width() || reference->color.height != frame.crop.height())
        return invalid_argument(name + ": the reference has another size than the frame");

    RegionMeans rendered(3, 3);
    const std::vector<double> means = luminance_means(reference->color, 3, 3);
    const double reference_error = double(entry.at("mean_y_se")) / double(entry.at("mean_y"));
    const double image_level = sidak(0.05, int(tests)), region_level = sidak(0.05, int(9 * tests));
    const auto ratio = [&](size_t r) {
        const double error = means[r] * reference_error * (r == 0 ? 1 : 3);
        return ratio_interval(rendered.estimates()[r], {means[r], error * error}, r == 0 ? image_level : region_level);
    };

    constexpr uint32_t kIterations = 2, kLeastGroups = 16;
    Accumulation total(frame);
    Outcome outcome;
    const auto start = std::chrono::steady_clock::now();
    for (uint32_t group = 0;; ++group) {
        const UnitWork work{uint64_t(group) * kIterations, kIterations, group, frame.crop, 0,
                            uint64_t(kIterations) * uint64_t(frame.crop.area())};
        auto partial = (*renderer)->render(work, {});
        if (!partial.ok()) return partial.status();
        GroupSum sum(frame);
        Accumulation alone(frame);
        LL_RETURN_IF_ERROR(sum.add(*partial));
        LL_RETURN_IF_ERROR(alone.fold(sum, kIterations));
        LL_RETURN_IF_ERROR(total.fold(sum, kIterations));
        rendered.add(alone.develop(exposure), kIterations);
        outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (group + 1 < kLeastGroups) continue;
        outcome.image = ratio(0);
        bool settled = outcome.image.within(options.bound);
        for (size_t r = 0; r < 9; ++r) {
            outcome.regions[r] = ratio(r + 1);
            settled &= outcome.regions[r].within(options.region_bound);
        }
        if (settled || outcome.seconds >= options.seconds) break;
    }
    outcome.iterations = total.iterations();
    outcome.dropped = total.dropped();
    if (!options.pictures.empty()) {
        const std::string stem = options.pictures + "/" + name + "-" + algorithm;
        LL_RETURN_IF_ERROR(write_png(stem + ".png", total.develop(exposure)));
        LL_RETURN_IF_ERROR(write_png8(stem + "-error.png", frame.crop.width(), frame.crop.height(),
                                      signed_error_picture(total.develop(exposure), reference->color, 0.2)));
    }
    return outcome;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Equivalence of image means with reference images");
    Options options;
    app.add_option("shared", options.shared, "directory with scenes/ and refs/")->required();
    app.add_option("--only", options.only, "scenes, comma separated")->delimiter(',');
    app.add_option("--algorithms", options.algorithms)->delimiter(',');
    app.add_option("--seconds", options.seconds, "at most, per scene and algorithm");
    app.add_option("--bound", options.bound, "of the image mean");
    app.add_option("--region-bound", options.region_bound, "of a region's mean");
    app.add_option("--seed", options.seed);
    app.add_option("--json", options.json, "one object per line");
    app.add_option("--pictures", options.pictures, "directory for the image and the signed error");
    CLI11_PARSE(app, argc, argv);
    std::ifstream file(options.shared + "/refs/refs.json");
    if (!file) return std::fprintf(stderr, "%s/refs/refs.json cannot be read\n", options.shared.c_str()), 2;
    const auto refs = nlohmann::ordered_json::parse(file);
    std::ofstream json(options.json, std::ios::app);
    bool differ = false;
    const size_t tests = refs.size() * options.algorithms.size();
    std::printf("%-18s %-5s %5s %6s  %-26s %s\n", "scene", "alg", "spp", "s", "mean ratio [interval]", "regions (ratio +- half width)");
    for (const auto& [name, entry] : refs.items()) {
        if (!options.only.empty() && std::find(options.only.begin(), options.only.end(), name) == options.only.end()) continue;
        for (const std::string& algorithm : options.algorithms) {
            const auto outcome = compare_means(options, name, entry, algorithm, tests);
            if (!outcome.ok()) {
                std::fprintf(stderr, "%s %s: %s\n", name.c_str(), algorithm.c_str(), outcome.status().message().c_str());
                return 2;
            }
            const RatioInterval& image = outcome->image;
            std::printf("%-18s %-5s %5llu %6.1f  %.4f [%.4f, %.4f] %c ", name.c_str(), algorithm.c_str(),
                        static_cast<unsigned long long>(outcome->iterations), outcome->seconds, image.ratio, image.low, image.high,
                        image.within(options.bound) ? '=' : image.excludes(options.bound) ? '!' : '?');
            nlohmann::ordered_json line{{"scene", name},
                                        {"algorithm", algorithm},
                                        {"spp", outcome->iterations},
                                        {"seconds", outcome->seconds},
                                        {"dropped", outcome->dropped},
                                        {"image", to_json(image)}};
            for (const RatioInterval& r : outcome->regions) {
                std::printf(" %.3f+-%.3f", r.ratio, r.high - r.ratio);
                line["regions"].push_back(to_json(r));
            }
            std::printf("\n");
            std::fflush(stdout);
            if (!options.json.empty()) json << line.dump() << std::endl;
            differ |= image.excludes(options.bound);
        }
    }
    return differ ? 1 : 0;
}
