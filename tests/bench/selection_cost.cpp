// The cost of selection in `spcbpt`: the share of the rendering time, of one thread, that goes into kappa (labels of
// light sub-paths, of camera vertices, and of the prefixes and suffixes that weights ask for), into the index of the
// cache, and into two-stage sampling.
//
//   selection_cost SCENE [--iterations N] [--resolution WxH] [--set key=value ...]
//
// Every call is timed by the processor's counter; the time that reading the counter takes is subtracted from the calls
// and from the total.

#include <tbb/global_control.h>
#include <x86intrin.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "common/transport/parameters.h"
#include "common/transport/spcbpt.h"
#include "common/transport/training.h"
#include "common/work/job.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

namespace {

enum Part { kLightLabels, kIndex, kCameraLabels, kDraws, kWeightLabels, kParts };
constexpr const char* kNames[kParts] = {"kappa of light sub-paths", "index of the cache", "kappa of camera vertices",
                                        "two-stage sampling", "kappa for weights *"};

struct Clock {
    uint64_t cycles = 0, calls = 0;
};
Clock clocks[kParts];

template <class F>
auto timed(Part part, F&& f) {
    struct Stop {
        Clock& clock;
        uint64_t begin = __rdtsc();
        ~Stop() {
            clock.cycles += __rdtsc() - begin;
            ++clock.calls;
        }
    } stop{clocks[part]};
    return f();
}

/// SubspaceConnections, timed.
struct TimedConnections : SubspaceConnections<> {
    using Base = SubspaceConnections<>;
    void label_light_path(const Scene& scene, PathVertex* y, int n) const {
        timed(kLightLabels, [&] { Base::label_light_path(scene, y, n); });
    }
    void label_camera_vertex(const Scene& scene, PathVertex* v) const {
        timed(kCameraLabels, [&] { Base::label_camera_vertex(scene, v); });
    }
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                  PathView* view) const {
        timed(kWeightLabels, [&] { Base::complete(scene, y, s, z, t, towards, view); });
    }
    Index index(const LightCache& cache, uint64_t paths) const {
        return timed(kIndex, [&] { return Base::index(cache, paths); });
    }
    template <class... Arguments>
    int draw(Arguments&&... arguments) const {
        return timed(kDraws, [&] { return Base::draw(std::forward<Arguments>(arguments)...); });
    }
};

/// Cycles that an empty call seems to take (`seen`), and that it really takes (`whole`).
struct Overhead {
    double seen, whole;
};
Overhead overhead() {
    constexpr int kCalls = 1000000;
    Clock& clock = clocks[kIndex];
    const uint64_t begin = __rdtsc();
    for (int i = 0; i < kCalls; ++i) timed(kIndex, [] { asm volatile(""); });
    const Overhead out{double(clock.cycles) / kCalls, double(__rdtsc() - begin) / kCalls};
    clock = {};
    return out;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("What selection costs spcbpt");
    std::string scene_path, resolution;
    std::vector<std::string> set;
    uint32_t iterations = 16;
    app.add_option("scene", scene_path)->required();
    app.add_option("--iterations", iterations);
    app.add_option("--resolution", resolution);
    app.add_option("--set", set);
    CLI11_PARSE(app, argc, argv);

    const bench::LoadedScene loaded = bench::load(scene_path, resolution);
    const std::shared_ptr<const Scene>& scene = loaded.scene;
    const RenderSettings settings = bench::settings_of("spcbpt", set, loaded);
    const AlgorithmSettings& chosen = settings.algorithm;
    const CacheParameters cache = CacheParameters::of(chosen);
    const RouletteRule roulette = roulette_of(chosen);
    TrainingReport report;
    const Tables tables = bench::value_or_exit(make_tables(*scene, settings, {}, &report));

    const auto prepared = std::make_shared<const PreparedTables>(*tables.get<SubspaceTables>());
    const SpcbptSelection selection = spcbpt_selection(
        prepared, {.light_paths_per_iteration = double(chosen.light_paths_per_iteration(scene->frame().crop.area())),
                   .connections = cache.connections,
                   .cache_paths = chosen.value("ris-aware") != 0 ? double(cache.minimum_paths) : 0,
                   .correction = chosen.info().learning->plan(chosen).correction,
                   .roulette = roulette});
    const CachedAlgorithm<TimedConnections> algorithm{
        {{selection, prepared, cache.connections}}, heuristic_of(chosen), cache.minimum_paths};
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const Overhead empty = overhead();
    // The units are those of a job, so that caches have the same size.
    const Plan plan(scene->frame(), chosen);
    const uint64_t begin = __rdtsc();
    for (const Group& group : plan.groups_for(iterations)) {
        for (const WorkUnit& unit : plan.units(group))
            (void)bench::value_or_exit(
                render_unit(algorithm, *scene, settings.seed, settings.max_edges(), roulette, unit.render, {}));
    }
    double whole = double(__rdtsc() - begin);
    for (const Clock& clock : clocks) whole -= double(clock.calls) * empty.whole;
    std::printf("%-26s %12s %14s %8s\n", "", "calls", "cycles a call", "share");
    double sum = 0;
    for (int p = 0; p < kParts; ++p) {
        const double cycles = std::max(0.0, double(clocks[p].cycles) - double(clocks[p].calls) * empty.seen);
        sum += cycles;
        std::printf("%-26s %12llu %14.0f %7.1f%%\n", kNames[p], static_cast<unsigned long long>(clocks[p].calls),
                    clocks[p].calls > 0 ? cycles / double(clocks[p].calls) : 0.0, 100 * cycles / whole);
    }
    std::printf("%-26s %12s %14s %7.1f%%\n", "together", "", "", 100 * sum / whole);
    std::printf("* with the throughput and footprint of every prefix, which the weights need as well\n");
}
