// kappa, the classifier, as sub-paths and weights ask it, and the draws from a cache: in two stages by learned tables, and
// uniformly.

#include "common/transport/lvcbpt.h"
#include "tests/bench/micro/count.h"
#include "tests/bench/micro/inputs.h"

namespace lightloom::bench {
namespace {

/// kappa_E of a camera vertex, with where kappa_L begins to depend on the direction.
void camera_labels(benchmark::State& state) {
    const Inputs& in = inputs();
    std::vector<PathVertex> vertices;
    for (const CameraVertex& v : in.camera_vertices) vertices.push_back((*v.z)[size_t(v.t - 1)]);
    for (auto _ : state)
        for (PathVertex& v : vertices) {
            in.algorithm.method.label_camera_vertex(*in.scene, &v);
            benchmark::DoNotOptimize(v.label);
        }
    count_items(state, vertices.size(), "vertices");
}
BENCHMARK(camera_labels)->Name("kappa/camera vertices")->Unit(benchmark::kMicrosecond);

void light_labels(benchmark::State& state) {
    const Inputs& in = inputs();
    SubPaths paths = in.light_paths;
    uint64_t vertices = 0;
    for (const auto& y : paths) vertices += y.size();
    for (auto _ : state)
        for (std::vector<PathVertex>& y : paths) {
            in.algorithm.method.label_light_path(*in.scene, y.data(), int(y.size()));
            benchmark::DoNotOptimize(y.data());
        }
    count_items(state, vertices, "vertices");
}
BENCHMARK(light_labels)->Name("kappa/light sub-paths")->Unit(benchmark::kMicrosecond);

/// Labels, throughputs and footprint of all prefixes and suffixes of a connected path, which its weight asks for.
void path_labels(benchmark::State& state) {
    const Inputs& in = inputs();
    struct Connected {
        DrawnPair pair;
        std::vector<PathVertex> z;
        Vec3 towards;
        PathView view;
    };
    constexpr size_t kViews = 256;
    std::vector<Connected> connected;
    WalkCounters counters;
    PathView view;
    // Pairs of all of the frame: most are not in sight of each other.
    for (size_t i = 0; i < in.pairs.size() && connected.size() < kViews; i += 17) {
        const DrawnPair& pair = in.pairs[i];
        const auto& [z, t] = pair.camera;
        const Rgb c = connect_candidate<ViewDetail::kSubspace>(*in.scene, pair.pick.y, pair.pick.s, z->data(), t, &view, &counters);
        if (c.is_black()) continue;
        const Vec3 towards = normalize(pair.pick.y[pair.pick.s - 1].p - (*z)[size_t(t - 1)].p);
        connected.push_back({pair, std::vector<PathVertex>(z->begin(), z->begin() + t), towards, view});
    }
    for (auto _ : state)
        for (Connected& c : connected) {
            // These are filled in on demand, once for all connections of a camera vertex.
            for (PathVertex& v : c.z) v.reverse_label = kNoLabel;
            in.algorithm.method.complete(*in.scene, c.pair.pick.y, c.pair.pick.s, c.z.data(), c.pair.camera.t, c.towards, &c.view);
            benchmark::DoNotOptimize(c.view.light_label[1]);
        }
    count_items(state, connected.size(), "paths");
}
BENCHMARK(path_labels)->Name("kappa/connected paths")->Unit(benchmark::kMicrosecond);

template <class Method, class Index>
void draw(benchmark::State& state, const Method& method, const Index& index) {
    const Inputs& in = inputs();
    Rng rng({kSeed, Stage::kPairing});
    LightPick picks[kMaxConnections];
    for (auto _ : state)
        for (const CameraVertex& v : in.camera_vertices) {
            const int count = method.draw(
                in.state.cache, index, (*v.z)[size_t(v.t - 1)], v.t, [&] { return rng.uniform2(); }, rng, in.max_edges + 1 - v.t,
                picks);
            benchmark::DoNotOptimize(count);
            benchmark::DoNotOptimize(picks);
        }
    uint64_t draws = 0;
    for (const CameraVertex& v : in.camera_vertices) draws += uint64_t(method.connections(v.t));
    count_items(state, draws, "draws");
}

void draw_in_two_stages(benchmark::State& state) { draw(state, inputs().algorithm.method, inputs().state.index); }
BENCHMARK(draw_in_two_stages)->Name("draw/two stages")->Unit(benchmark::kMicrosecond);

void draw_uniformly(benchmark::State& state) {
    const Inputs& in = inputs();
    const UniformConnections<> method{{}, in.algorithm.method.connections};
    // The prefixes of the other index, in its order by subspaces; which order it is does not matter here.
    UniformConnections<>::Index index;
    for (const auto& candidate : in.state.index.candidates) index.candidates.push_back(candidate.prefix);
    draw(state, method, index);
}
BENCHMARK(draw_uniformly)->Name("draw/uniform")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace lightloom::bench
