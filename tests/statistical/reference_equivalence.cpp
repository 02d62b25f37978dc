// Equivalence of the image mean with an independent renderer's reference: renders a scene for a while, forms independent
// group images, and reports confidence intervals of the ratio of mean luminances, for the whole image and a 3 x 3 grid.
//
//   reference_equivalence SCENE REF.exr --resolution WxH --algorithm A --seconds S [--reference-error REL] [--tests N]
//       [--png OUT.png] [--heat OUT.png]
//
// One JSON object per line on standard output. The interval is two-sided, Sidak-corrected over --tests, and includes the
// reference's own relative standard error (scaled by 3 for a region, which has a ninth of the pixels).

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/film/accumulation.h"
#include "common/film/exr_io.h"
#include "common/film/metrics.h"
#include "common/film/png.h"
#include "common/import/import.h"
#include "common/transport/renderer.h"

using namespace lightloom;

namespace {

/// Upper quantile of the normal distribution, by bisection of erfc.
double normal_quantile(double upper_tail) {
    double lo = 0, hi = 40;
    for (int i = 0; i < 200; ++i) {
        const double mid = (lo + hi) / 2;
        (0.5 * std::erfc(mid / std::sqrt(2.0)) > upper_tail ? lo : hi) = mid;
    }
    return lo;
}

struct Region {
    double sum = 0, sum2 = 0, reference = 0;
    int groups = 0;
    void add(double mean) { sum += mean, sum2 += mean * mean, ++groups; }
    double mean() const { return sum / groups; }
    double standard_error() const { return std::sqrt(std::fmax(0, sum2 / groups - mean() * mean()) / (groups - 1)); }
};

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Equivalence of the mean with a reference image");
    std::string scene_path, reference_path, resolution, algorithm = "path", png, heat;
    double seconds = 30, reference_error = 0;
    int tests = 34;
    uint64_t seed = 1;
    app.add_option("scene", scene_path)->required();
    app.add_option("reference", reference_path)->required();
    app.add_option("--resolution", resolution);
    app.add_option("--algorithm", algorithm);
    app.add_option("--seconds", seconds);
    app.add_option("--reference-error", reference_error);
    app.add_option("--tests", tests);
    app.add_option("--seed", seed);
    app.add_option("--png", png);
    app.add_option("--heat", heat);
    CLI11_PARSE(app, argc, argv);
    const auto fail = [](const Status& s) {
        std::fprintf(stderr, "%s\n", s.message().c_str());
        return 2;
    };

    auto imported = import_pbrt(scene_path);
    if (!imported.ok()) return fail(imported.status());
    SceneOptions options;
    if (!resolution.empty() && std::sscanf(resolution.c_str(), "%dx%d", &options.width, &options.height) != 2) return 2;
    RenderSettings settings;
    settings.algorithm = algorithm;
    settings.max_depth = imported->description.max_depth;
    settings.seed = seed;
    auto built = Scene::build(std::move(imported->description), options);
    if (!built.ok()) return fail(built.status());
    const std::shared_ptr<const Scene> scene = std::move(built).value();
    auto renderer = Renderer::create(scene, settings);
    if (!renderer.ok()) return fail(renderer.status());
    auto reference = read_exr(reference_path);
    if (!reference.ok()) return fail(reference.status());

    const FrameLayout frame = scene->frame();
    if (reference->color.width != frame.crop.width() || reference->color.height != frame.crop.height()) {
        std::fprintf(stderr, "%s is %dx%d, the frame %dx%d\n", reference_path.c_str(), reference->color.width,
                     reference->color.height, frame.crop.width(), frame.crop.height());
        return 2;
    }
    Region regions[10];
    const int w = frame.crop.width(), h = frame.crop.height();
    const auto luminance_means = [&](const RgbImage& image, double means[10]) {
        double count[10] = {};
        std::fill(means, means + 10, 0.0);
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                const float* p = &image.pixels[(size_t(y) * size_t(w) + size_t(x)) * 3];
                const double l = 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
                const int r = 1 + (y * 3 / h) * 3 + x * 3 / w;
                means[0] += l, ++count[0];
                means[r] += l, ++count[r];
            }
        for (int r = 0; r < 10; ++r) means[r] /= count[r];
    };
    double means[10];
    luminance_means(reference->color, means);
    for (int r = 0; r < 10; ++r) regions[r].reference = means[r];

    Accumulation total(frame);
    const auto start = std::chrono::steady_clock::now();
    const auto elapsed = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
    const uint32_t per_group = 4;
    uint32_t group = 0;
    do {
        UnitWork work{uint64_t(group) * per_group, per_group, uint64_t(group) * per_group, frame.crop, 0, uint64_t(per_group) * uint64_t(frame.crop.area())};
        auto partial = (*renderer)->render(work, {});
        if (!partial.ok()) return fail(partial.status());
        GroupSum sum(frame), alone(frame);
        Accumulation single(frame);
        if (Status s = sum.add(*partial); !s.ok()) return fail(s);
        if (Status s = total.fold(sum, per_group); !s.ok()) return fail(s);
        if (Status s = alone.add(*partial); !s.ok()) return fail(s);
        if (Status s = single.fold(alone, per_group); !s.ok()) return fail(s);
        luminance_means(single.develop(), means);
        for (int r = 0; r < 10; ++r) regions[r].add(means[r]);
        ++group;
    } while (elapsed() < seconds || group < 8);

    const double tail = 0.5 * (1 - std::pow(0.95, 1.0 / (tests)));
    const double tail_regions = 0.5 * (1 - std::pow(0.95, 1.0 / (9.0 * tests)));
    nlohmann::ordered_json out;
    out["algorithm"] = algorithm;
    out["spp"] = total.iterations();
    out["seconds"] = elapsed();
    out["dropped"] = total.dropped();
    const auto interval = [&](const Region& r, double z, double relative_reference_error) {
        const double ratio = r.mean() / r.reference;
        const double relative = std::hypot(r.standard_error() / r.reference, ratio * relative_reference_error);
        return nlohmann::ordered_json{{"ratio", ratio}, {"low", ratio - z * relative}, {"high", ratio + z * relative}};
    };
    out["image"] = interval(regions[0], normal_quantile(tail), reference_error);
    for (int r = 1; r < 10; ++r)
        out["regions"].push_back(interval(regions[r], normal_quantile(tail_regions), 3 * reference_error));
    std::printf("%s\n", out.dump().c_str());
    const RgbImage image = total.develop();
    if (!png.empty())
        if (Status s = write_png(png, image); !s.ok()) return fail(s);
    if (!heat.empty())
        if (Status s = write_png8(heat, w, h, signed_error_picture(image, reference->color, 0.2)); !s.ok()) return fail(s);
    return 0;
}
