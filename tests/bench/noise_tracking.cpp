// How well the error that a rendering estimates from its own groups (NoiseEstimate) tracks its true error: their ratio at the end
// of the last octaves of iterations, for each algorithm and seed, against a long rendering by one algorithm with another seed.
//
//   noise_tracking SCENE [--algorithms path,bdpt] [--iterations N] [--octaves N] [--seeds N] [--resolution WxH]
//                  [--reference ALGORITHM] [--reference-iterations N]

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "tests/bench/bench_scene.h"
#include "tests/support/noise_tracking.h"

using namespace lightloom;

int main(int argc, char** argv) {
    CLI::App app("Estimated against true relMSE");
    std::string scene_path, resolution = "96x54", referee = "bdpt", algorithms = "path,bdpt";
    uint64_t iterations = 256, reference_iterations = 4096;
    int octaves = 3, seeds = 3;
    app.add_option("scene", scene_path)->required();
    app.add_option("--algorithms", algorithms);
    app.add_option("--iterations", iterations)->check(CLI::Range(16, 1 << 20));
    app.add_option("--octaves", octaves)->check(CLI::Range(1, 12));
    app.add_option("--seeds", seeds)->check(CLI::Range(1, 1000));
    app.add_option("--resolution", resolution);
    app.add_option("--reference", referee);
    app.add_option("--reference-iterations", reference_iterations);
    CLI11_PARSE(app, argc, argv);

    int width = 0, height = 0;
    if (std::sscanf(resolution.c_str(), "%dx%d", &width, &height) != 2)
        return std::fprintf(stderr, "--resolution takes WIDTHxHEIGHT, not \"%s\"\n", resolution.c_str()), 2;
    const auto scene = bench::value_or_exit(testing::load_tracked(scene_path, width, height));
    const auto reference = bench::value_or_exit(testing::make_tracked_reference(scene, referee, reference_iterations));
    std::printf("%s, reference: %llu iterations of %s, relMSE %.2g\n", scene_path.c_str(),
                static_cast<unsigned long long>(reference_iterations), referee.c_str(), reference.relmse);
    for (const std::string& algorithm : client::split_algorithms(algorithms)) {
        std::vector<std::vector<testing::TrackedPoint>> tracks;
        for (int seed = 1; seed <= seeds; ++seed)
            tracks.push_back(
                bench::value_or_exit(testing::track_noise(scene, reference, algorithm, uint64_t(seed), iterations, octaves + 1)));
        std::printf("%s\n", algorithm.c_str());
        for (size_t i = 0; i < tracks[0].size(); ++i) {
            double truth = 0, estimate = 0, error = 0, low = HUGE_VAL, high = 0;
            for (const auto& track : tracks) {
                truth += track[i].relmse / seeds;
                estimate += track[i].estimate.relmse / seeds;
                error += track[i].estimate.error / seeds;
                low = std::min(low, track[i].ratio()), high = std::max(high, track[i].ratio());
            }
            std::printf("  %6llu iterations  true %9.3g  estimated %9.3g +- %3.0f %%  ratio %.2f to %.2f\n",
                        static_cast<unsigned long long>(tracks[0][i].iterations), truth, estimate, 100 * error / estimate, low,
                        high);
        }
        std::fflush(stdout);
    }
    return 0;
}
