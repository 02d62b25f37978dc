// The ways to complete a path: evaluation of both ends, visibility, and the view of the whole path.

#include "tests/bench/micro/count.h"
#include "tests/bench/micro/inputs.h"

namespace lightloom::bench {
namespace {

/// Camera vertices and what they have drawn from the cache.
void to_cache(benchmark::State& state) {
    const Inputs& in = inputs();
    PathView view;
    WalkCounters counters;
    for (auto _ : state)
        for (const DrawnPair& pair : in.pairs) {
            const auto& [z, t] = pair.camera;
            benchmark::DoNotOptimize(
                connect_candidate<ViewDetail::kSubspace>(*in.scene, pair.pick.y, pair.pick.s, z->data(), t, &view, &counters));
        }
    count_items(state, in.pairs.size(), "pairs");
}
BENCHMARK(to_cache)->Name("connection/to the cache")->Unit(benchmark::kMicrosecond);

/// Every vertex of a camera sub-path with every vertex of a light sub-path.
void all_pairs(benchmark::State& state) {
    const Inputs& in = inputs();
    constexpr size_t kSubPaths = 256;
    PathView view;
    uint64_t pairs = 0;
    for (auto _ : state) {
        WalkCounters counters;
        pairs = 0;
        for (size_t n = 0; n < kSubPaths; ++n) {
            const std::vector<PathVertex>&z = in.camera_paths[n * kPaths / kSubPaths], &y = in.light_paths[n];
            for (int t = 2; t <= int(z.size()); ++t) {
                if (!z[size_t(t - 1)].bsdf.has_smooth_lobe()) continue;
                for (int s = 2; s <= int(y.size()) && s + t - 1 <= in.max_edges; ++s) {
                    if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                    benchmark::DoNotOptimize(connect<ViewDetail::kFull>(*in.scene, y.data(), s, z.data(), t, &view, &counters));
                    ++pairs;
                }
            }
        }
    }
    count_items(state, pairs, "pairs");
}
BENCHMARK(all_pairs)->Name("connection/all pairs")->Unit(benchmark::kMicrosecond);

void next_event_estimation(benchmark::State& state) {
    const Inputs& in = inputs();
    PathView view;
    for (auto _ : state) {
        WalkCounters counters;
        CameraSampler sampler(kSeed, 0, 0);
        for (const CameraVertex& v : in.camera_vertices)
            contribute_next_event<ViewDetail::kFull>(
                *in.scene, v.z->data(), v.t, sampler, 1, &view, &counters,
                [](const PathContribution& c, PathView&) { benchmark::DoNotOptimize(c.value); });
    }
    count_items(state, in.camera_vertices.size(), "vertices");
}
BENCHMARK(next_event_estimation)->Name("connection/next event")->Unit(benchmark::kMicrosecond);

void to_lens(benchmark::State& state) {
    const Inputs& in = inputs();
    PathView view;
    uint64_t vertices = 0;
    for (const auto& y : in.light_paths)
        for (size_t s = 2; s <= y.size(); ++s) vertices += y[s - 1].bsdf.has_smooth_lobe();
    for (auto _ : state) {
        WalkCounters counters;
        LightSampler sampler({kSeed, Stage::kLight, 0, 0});
        PathVertex z0;
        for (const auto& y : in.light_paths)
            contribute_to_lens(*in.scene, sampler, y.data(), int(y.size()), &z0, &view, &counters,
                               [](const PathContribution& c, PathView&) { benchmark::DoNotOptimize(c.value); });
    }
    count_items(state, vertices, "vertices");
}
BENCHMARK(to_lens)->Name("connection/to the lens")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lightloom::bench
