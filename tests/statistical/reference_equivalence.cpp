// Equivalence of image means with an independent renderer's references: renders every scene that has one with each
// algorithm and reports confidence intervals of the ratio of mean luminances, for the whole image and a 3 x 3 grid.
//
//   reference_equivalence SHARED_DIR [--only house,door] [--algorithms path,bdpt] [--seconds 60] [--json OUT.jsonl]
//   reference_equivalence SHARED_DIR --light           instead: light tracing against what bdpt has in common with it
//   reference_equivalence SHARED_DIR --spectral        instead: RGB against spectra, which the references are made with
//   reference_equivalence SHARED_DIR --missing         instead: what bdpt can sample by hits only, on the sds scenes
//
// SHARED_DIR holds scenes/NAME/scene.pbrt, refs/NAME.exr and refs/refs.json. The intervals are two-sided at 95 %,
// Sidak-corrected over all scenes and algorithms (and regions), from the spread of independent group images, and include the
// reference's own relative standard error (three times that for a region, which has a ninth of the pixels). Rendering of a
// scene ends when its interval lies within the bound or after --seconds. Exit code 1 if some interval excludes the bound
// altogether: then the means differ.

#include "tests/statistical/reference_equivalence.h"

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>

#include "common/film/exr_io.h"
#include "common/film/png.h"
#include "common/metrics/metrics.h"

using namespace lightloom;
using namespace lightloom::equivalence;

namespace {

struct Outcome {
    Rendering rendering;
    RatioInterval image, regions[9];
    double channel_ratios[3];
};

Result<Outcome> compare_means(const Options& options, const std::string& name, const nlohmann::json& entry,
                              const LoadedScene& loaded, const std::string& algorithm, size_t tests) {
    auto render = catalog_group(loaded, algorithm, options.seed);
    if (!render.ok()) return render.status();
    auto reference = read_exr(options.shared + "/refs/" + name + ".exr");
    if (!reference.ok()) return reference.status();
    const Rect crop = loaded.scene->frame().crop;
    if (reference->color.width != crop.width() || reference->color.height != crop.height())
        return invalid_argument(name + ": the reference has another size than the frame");
    const PartMeans expected = part_means(reference->color);
    const double reference_error = double(entry.at("mean_y_se")) / double(entry.at("mean_y"));
    const double image_level = sidak(0.05, int(tests)), region_level = sidak(0.05, int(9 * tests));
    const auto ratio = [&](const Rendering& r, size_t part, double error_scale, double level) {
        const double error = expected[part] * reference_error * error_scale;
        return ratio_interval(r.mean(part), {expected[part], error * error}, level);
    };

    Outcome outcome;
    const auto settled = [&](const Rendering& r) {
        outcome.image = ratio(r, kImage, 1, image_level);
        bool all = outcome.image.within(options.bound);
        for (size_t i = 0; i < 9; ++i) {
            outcome.regions[i] = ratio(r, kFirstRegion + i, 3, region_level);
            all &= outcome.regions[i].within(options.region_bound);
        }
        return all;
    };
    auto rendered = render_groups(*loaded.scene, *render, options.seconds, settled);
    if (!rendered.ok()) return rendered.status();
    outcome.rendering = std::move(rendered).value();
    settled(outcome.rendering);
    for (size_t c = 0; c < 3; ++c)
        outcome.channel_ratios[c] = outcome.rendering.mean(kFirstChannel + c).mean / expected[kFirstChannel + c];
    if (!options.pictures.empty()) {
        const std::string stem = options.pictures + "/" + name + "-" + algorithm;
        LL_RETURN_IF_ERROR(write_png(stem + ".png", outcome.rendering.picture));
        LL_RETURN_IF_ERROR(write_png8(stem + "-error.png", crop.width(), crop.height(),
                                      signed_error_picture(outcome.rendering.picture, reference->color, 0.2)));
    }
    return outcome;
}

void print(const std::string& name, const std::string& algorithm, const Outcome& outcome, double bound) {
    const RatioInterval& image = outcome.image;
    std::printf("%-18s %-5s %5llu %6.1f  %.4f [%.4f, %.4f] %c  %.3f %.3f %.3f ", name.c_str(), algorithm.c_str(),
                static_cast<unsigned long long>(outcome.rendering.iterations), outcome.rendering.seconds, image.ratio, image.low,
                image.high,
                image.within(bound)     ? '='
                : image.excludes(bound) ? '!'
                                        : '?',
                outcome.channel_ratios[0], outcome.channel_ratios[1], outcome.channel_ratios[2]);
    for (const RatioInterval& r : outcome.regions) std::printf(" %.3f+-%.3f", r.ratio, r.high - r.ratio);
    std::printf("\n");
    std::fflush(stdout);
}

nlohmann::ordered_json json_line(const std::string& name, const std::string& algorithm, const Outcome& outcome) {
    nlohmann::ordered_json line{{"scene", name},
                                {"algorithm", algorithm},
                                {"spp", outcome.rendering.iterations},
                                {"seconds", outcome.rendering.seconds},
                                {"dropped", outcome.rendering.dropped},
                                {"image", to_json(outcome.image)},
                                {"channels", outcome.channel_ratios}};
    for (const RatioInterval& r : outcome.regions) line["regions"].push_back(to_json(r));
    return line;
}

void print_own(const std::string& name, const char* what, const RatioInterval& ratio) {
    std::printf("%-18s %-30s  %.4f [%.4f, %.4f] %s\n", name.c_str(), what, ratio.ratio, ratio.low, ratio.high,
                ratio.within(0.005)     ? "="
                : ratio.excludes(0.005) ? "!"
                                        : "?");
    std::fflush(stdout);
}

/// Exit code.
int run(const Options& options) {
    std::ifstream file(options.shared + "/refs/refs.json");
    if (!file) return std::fprintf(stderr, "%s/refs/refs.json cannot be read\n", options.shared.c_str()), 2;
    const auto refs = nlohmann::ordered_json::parse(file);
    const auto failed = [](const std::string& name, const Status& status) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), status.message().c_str());
        return 2;
    };
    if (options.missing) {
        const Status status = print_missing_energy(options);
        return status.ok() ? 0 : failed("missing energy", status);
    }
    std::ofstream json(options.json, std::ios::app);
    const auto write = [&](const nlohmann::ordered_json& line) {
        if (!options.json.empty()) json << line.dump() << std::endl;
    };
    bool differ = false;
    const size_t tests = refs.size() * options.algorithms.size();
    std::printf("%-18s %-5s %5s %6s  %-26s %-17s %s\n", "scene", "alg", "spp", "s", "mean ratio [interval]", "r g b",
                "regions (ratio +- half width)");
    for (const auto& [name, entry] : refs.items()) {
        if (!options.only.empty() && std::find(options.only.begin(), options.only.end(), name) == options.only.end()) continue;
        if (options.spectral) {
            if (const Status status = print_spectral_ratio(options, name, entry.at("resolution")); !status.ok())
                return failed(name, status);
            continue;
        }
        auto loaded = load_scene(options, name, entry.at("resolution"));
        if (!loaded.ok()) return failed(name, loaded.status());
        const double own_level = sidak(0.05, int(2 * refs.size()));
        if (options.light) {
            nlohmann::ordered_json line{{"scene", name}, {"own", "light/bdpt"}};
            const auto ratio = light_against_bdpt(options, *loaded, own_level, &line);
            if (!ratio.ok()) return failed(name + " light", ratio.status());
            print_own(name, "light / bdpt", *ratio);
            line["ratio"] = to_json(*ratio);
            write(line);
            differ |= ratio->excludes(0.005);
            continue;
        }
        std::map<std::string, Estimate> means;
        for (const std::string& algorithm : options.algorithms) {
            const auto outcome = compare_means(options, name, entry, *loaded, algorithm, tests);
            if (!outcome.ok()) return failed(name + " " + algorithm, outcome.status());
            means[algorithm] = outcome->rendering.mean(kImage);
            print(name, algorithm, *outcome, options.bound);
            write(json_line(name, algorithm, *outcome));
            differ |= outcome->image.excludes(options.bound);
        }
        if (means.count("path") && means.count("bdpt")) {
            const RatioInterval ratio = ratio_interval(means["path"], means["bdpt"], own_level);
            print_own(name, "path / bdpt", ratio);
            write({{"scene", name}, {"own", "path/bdpt"}, {"ratio", to_json(ratio)}});
            differ |= ratio.excludes(0.005);
        }
    }
    return differ ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Equivalence of image means with reference images");
    Options options;
    app.add_option("shared", options.shared, "directory with scenes/ and refs/")->required();
    app.add_option("--only", options.only, "scenes, comma separated")->delimiter(',');
    app.add_option("--algorithms", options.algorithms, "compared with the references")->delimiter(',');
    app.add_option("--seconds", options.seconds, "at most, per scene and algorithm");
    app.add_option("--bound", options.bound, "of the image mean");
    app.add_option("--region-bound", options.region_bound, "of a region's mean");
    app.add_option("--seed", options.seed);
    app.add_option("--threads", options.threads, "0: all");
    app.add_option("--json", options.json, "one object per line");
    app.add_option("--pictures", options.pictures, "directory for the image and the signed error");
    app.add_flag("--light", options.light, "only compare light with what bdpt and it have in common");
    app.add_flag("--missing", options.missing, "only list the energy that bdpt can make by hits alone");
    app.add_flag("--spectral", options.spectral, "only compare rendering in RGB with rendering in spectra");
    CLI11_PARSE(app, argc, argv);
    const size_t all = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, options.threads > 0 ? options.threads : all);
    return run(options);
}
