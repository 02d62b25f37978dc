// The random walk of both sub-paths: sampling, intersection, material and scattering of every vertex.

#include "tests/bench/micro/count.h"
#include "tests/bench/micro/inputs.h"

namespace lightloom::bench {
namespace {

void camera(benchmark::State& state) {
    const Inputs& in = inputs();
    std::vector<PathVertex> z(size_t(in.max_edges) + 2);
    uint64_t vertices = 0;
    for (auto _ : state) {
        WalkCounters counters;
        for (int n = 0; n < kPaths; ++n) {
            const CameraSample at = camera_sample(*in.scene, n);
            CameraSampler sampler(kSeed, 0, at.pixel);
            trace_camera_path(
                *in.scene, sampler, at.px, at.py, in.max_edges, {}, z.data(), &counters, [](int) {}, [](int, const WalkRay&) {});
        }
        benchmark::DoNotOptimize(z.data());
        vertices = counters.vertices;
    }
    count_items(state, vertices, "vertices");
}
BENCHMARK(camera)->Name("walk/camera")->Unit(benchmark::kMicrosecond);

void light(benchmark::State& state) {
    const Inputs& in = inputs();
    std::vector<PathVertex> y(size_t(in.max_edges) + 1);
    uint64_t vertices = 0;
    for (auto _ : state) {
        WalkCounters counters;
        for (uint64_t n = 0; n < kPaths; ++n) {
            LightSampler sampler({kSeed, Stage::kLight, 0, n});
            trace_light_path(*in.scene, sampler, in.max_edges, {}, y.data(), &counters);
        }
        benchmark::DoNotOptimize(y.data());
        vertices = counters.vertices;
    }
    count_items(state, vertices, "vertices");
}
BENCHMARK(light)->Name("walk/light")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lightloom::bench
