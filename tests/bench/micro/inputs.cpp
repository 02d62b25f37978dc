#include "tests/bench/micro/inputs.h"

#include "common/transport/parameters.h"
#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

namespace lightloom::bench {
namespace {

SpcbptAlgorithm<> algorithm_of(const Scene& scene, const AlgorithmSettings& settings, const Tables& tables) {
    const CacheParameters cache = CacheParameters::of(settings);
    const auto prepared = std::make_shared<const PreparedTables>(*tables.get<SubspaceTables>());
    const SpcbptSelection selection = spcbpt_selection(
        prepared, {.light_paths_per_iteration = double(settings.light_paths_per_iteration(scene.frame().crop.area())),
                   .connections = cache.connections,
                   .correction = settings.info().learning->plan(settings).correction,
                   .roulette = roulette_of(settings)});
    return {{selection, prepared, cache.connections}, heuristic_of(settings), cache.minimum_paths};
}

SubPaths trace_camera_paths(const Inputs& in) {
    SubPaths paths(kPaths);
    WalkCounters counters;
    for (int n = 0; n < kPaths; ++n) {
        std::vector<PathVertex>& z = paths[size_t(n)];
        z.resize(size_t(in.max_edges) + 2);
        const CameraSample at = camera_sample(*in.scene, n);
        CameraSampler sampler(kSeed, 0, at.pixel);
        const auto label = [&](int t) {
            if (t <= in.max_edges && z[size_t(t - 1)].bsdf.has_smooth_lobe())
                in.algorithm.method.label_camera_vertex(*in.scene, &z[size_t(t - 1)]);
        };
        const auto ignore = [](int, const WalkRay&) {};
        z.resize(size_t(trace_camera_path(*in.scene, sampler, at.px, at.py, in.max_edges, {}, z.data(), &counters, label, ignore)));
    }
    return paths;
}

SubPaths trace_light_paths(const Inputs& in) {
    SubPaths paths(kPaths);
    WalkCounters counters;
    for (size_t n = 0; n < paths.size(); ++n) {
        paths[n].resize(size_t(in.max_edges));
        LightSampler sampler({kSeed, Stage::kLight, 0, n});
        const int length = trace_light_path(*in.scene, sampler, in.max_edges, {}, paths[n].data(), &counters);
        paths[n].resize(size_t(length));
        in.algorithm.method.label_light_path(*in.scene, paths[n].data(), length);
    }
    return paths;
}

Inputs make() {
    const LoadedScene loaded = load(kScene, "160x90");
    const RenderSettings settings = settings_of("spcbpt", {"training-paths=5000"}, loaded);
    TrainingReport report;
    const Tables tables = value_or_exit(make_tables(*loaded.scene, settings, {}, &report));
    Inputs in{
        loaded.scene, settings.max_edges(), tables, algorithm_of(*loaded.scene, settings.algorithm, tables), {}, {}, {}, {}, {}};
    UnitPreparation preparation;
    in.state = in.algorithm.prepare({*in.scene, kSeed, in.max_edges, {}, whole_frame(*in.scene, settings.algorithm, 1), {}},
                                    &preparation, AnyContribute{});
    in.camera_paths = trace_camera_paths(in);
    in.light_paths = trace_light_paths(in);
    for (const std::vector<PathVertex>& z : in.camera_paths)
        for (int t = 2; t <= int(z.size()) && t <= in.max_edges; ++t)
            if (z[size_t(t - 1)].bsdf.has_smooth_lobe()) in.camera_vertices.push_back({&z, t});
    Rng rng({kSeed, Stage::kPairing});
    for (const CameraVertex& v : in.camera_vertices) {
        LightPick picks[kMaxConnections];
        const int count = in.algorithm.method.draw(
            in.state.cache, in.state.index, (*v.z)[size_t(v.t - 1)], v.t, [&] { return rng.uniform2(); }, rng,
            in.max_edges + 1 - v.t, picks);
        for (int n = 0; n < count; ++n) in.pairs.push_back({v, picks[n]});
    }
    return in;
}

}  // namespace

const Inputs& inputs() {
    // Vertices point into the sub-paths, which moving leaves where they are.
    static const Inputs made = make();
    return made;
}

CameraSample camera_sample(const Scene& scene, int n) {
    const Rect& crop = scene.frame().crop;
    const uint64_t pixel = uint64_t(n) * uint64_t(crop.area()) / kPaths;
    const int x = crop.x0 + int(pixel % uint64_t(crop.width())), y = crop.y0 + int(pixel / uint64_t(crop.width()));
    return {pixel, x, y};
}

}  // namespace lightloom::bench
