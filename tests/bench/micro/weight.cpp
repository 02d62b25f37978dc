// The weight of a path whose view and labels are complete, for each algorithm, over paths as it finds them.

#include <map>
#include <string>

#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/micro/count.h"
#include "tests/bench/micro/inputs.h"

namespace lightloom::bench {
namespace {

struct WeightedPath {
    PathView view;
    Technique technique;
};
struct WeightedPaths {
    std::unique_ptr<PathWeights> weights;
    std::vector<WeightedPath> paths;
};

/// Contributions of one iteration, each as likely as any other to be among the 256 that are kept.
WeightedPaths find_paths(const std::string& algorithm) {
    constexpr uint32_t kKept = 256;
    const LoadedScene loaded = load(kScene, "80x45");
    const bool cached = algorithm == "lvcbpt" || algorithm == "spcbpt";
    const auto set = cached ? std::vector<std::string>{"training-paths=5000", "cache=2000"} : std::vector<std::string>{};
    const RenderSettings settings = settings_of(algorithm, set, loaded);
    const auto renderer = value_or_exit(create_with_tables(loaded.scene, settings, {}));
    WeightedPaths found{renderer->weights(), {}};
    Rng rng({kSeed});
    uint32_t seen = 0;
    const auto see = [&](const SeenContribution& c) {
        if (c.view.k < 2) return;  // has no weight but one
        ++seen;
        if (found.paths.size() < kKept) {
            found.paths.push_back({c.view, c.found.technique});
        } else if (const uint32_t place = rng.below(seen); place < kKept) {
            found.paths[place] = {c.view, c.found.technique};
        }
    };
    (void)value_or_exit(renderer->watch(whole_frame(*loaded.scene, settings.algorithm, 1), see, {}));
    return found;
}

void weight(benchmark::State& state, const std::string& algorithm) {
    // A benchmark's function is called several times until its time is long enough.
    static std::map<std::string, WeightedPaths> found;
    if (!found.contains(algorithm)) found.emplace(algorithm, find_paths(algorithm));
    const auto& [weights, paths] = found.at(algorithm);
    for (auto _ : state)
        for (const WeightedPath& path : paths) benchmark::DoNotOptimize(weights->weight(path.view, path.technique));
    count_items(state, paths.size(), "weights");
}
BENCHMARK_CAPTURE(weight, path, std::string("path"))->Name("weight/path")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(weight, light, std::string("light"))->Name("weight/light")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(weight, bdpt, std::string("bdpt"))->Name("weight/bdpt")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(weight, lvcbpt, std::string("lvcbpt"))->Name("weight/lvcbpt")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(weight, spcbpt, std::string("spcbpt"))->Name("weight/spcbpt")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lightloom::bench
