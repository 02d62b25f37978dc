// Throughput of light transport alone: samples and rays per second of each algorithm on a scene, in one process with a
// given number of threads. Algorithms alternate over the repetitions, so that a drift of the machine affects all of
// them. Works for any algorithm of the catalog; tables are made first and not timed.
//
//   throughput SCENE [--algorithms path,bdpt:emission=learned:rr-min=0.7] [--iterations N] [--repetitions N] [--threads N]
//       [--resolution WxH]

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <sstream>

#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

int main(int argc, char** argv) {
    CLI::App app("Samples and rays per second of light transport");
    std::string scene_path;
    std::vector<std::string> algorithms{"path", "bdpt"};
    int iterations = 2, repetitions = 5, threads = 1;
    std::string resolution;
    app.add_option("scene", scene_path)->required();
    app.add_option("--algorithms", algorithms)->delimiter(',');
    app.add_option("--iterations", iterations);
    app.add_option("--repetitions", repetitions);
    app.add_option("--threads", threads);
    app.add_option("--resolution", resolution);
    CLI11_PARSE(app, argc, argv);

    tbb::global_control control(tbb::global_control::max_allowed_parallelism, size_t(threads));
    const bench::LoadedScene loaded = bench::load(scene_path, resolution);
    const std::shared_ptr<const Scene>& scene = loaded.scene;

    struct Row {
        AlgorithmSettings algorithm;
        std::unique_ptr<Renderer> renderer;
        std::vector<double> samples, rays, processor;  // the last: microseconds per sample
        double mean = 0;
    };
    std::vector<Row> rows(algorithms.size());
    for (size_t i = 0; i < rows.size(); ++i) {
        std::vector<std::string> parts;
        std::istringstream text(algorithms[i]);
        for (std::string part; std::getline(text, part, ':');) parts.push_back(part);
        const std::vector<std::string> set(parts.begin() + 1, parts.end());
        const RenderSettings settings = bench::settings_of(parts[0], set, loaded);
        rows[i].algorithm = settings.algorithm;
        rows[i].renderer = bench::value_or_exit(create_with_tables(scene, settings, {}));
    }
    const Rect crop = scene->frame().crop;
    const double samples = double(crop.area()) * iterations;
    for (int rep = 0; rep < repetitions; ++rep)
        for (Row& row : rows) {
            // Camera samples differ in each repetition; the light paths are those of the first.
            RenderUnit unit = bench::whole_frame(*scene, row.algorithm, uint32_t(iterations));
            unit.first_iteration = uint64_t(rep) * uint64_t(iterations);
            const std::clock_t processor = std::clock();
            const auto start = std::chrono::steady_clock::now();
            const auto partial = row.renderer->render(unit, {});
            const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            if (!partial.ok()) return std::fprintf(stderr, "%s\n", partial.status().message().c_str()), 1;
            row.processor.push_back(1e6 * double(std::clock() - processor) / CLOCKS_PER_SEC / samples);
            row.samples.push_back(samples / seconds);
            row.rays.push_back(double(partial->counters.rays) / seconds);
            double sum = 0;
            for (const double v : partial->camera) sum += v / samples;
            for (const SplatSum& s : partial->splats)
                sum += (s.rgb[0] + s.rgb[1] + s.rgb[2]) / double(partial->light_paths) / double(crop.area());
            row.mean += sum / 3 / repetitions;
        }
    const auto median = [](std::vector<double> v) {
        std::sort(v.begin(), v.end());
        return v[v.size() / 2];
    };
    for (size_t i = 0; i < rows.size(); ++i)
        std::printf(
            "%-8s %d thread(s)  %9.0f samples/s  %7.3f us of processor/sample  %6.3f M rays/s  %5.1f rays/sample  image mean "
            "%.6f\n",
            algorithms[i].c_str(), threads, median(rows[i].samples), median(rows[i].processor), median(rows[i].rays) * 1e-6,
            median(rows[i].rays) / median(rows[i].samples), rows[i].mean);
    return 0;
}
