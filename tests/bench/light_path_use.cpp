// Shows how many of the light sub-paths come into sight: the share that splats anything, and how many equally bright ones
// would splat as much, (sum v)^2 / sum v^2 over the paths. With emission by power it is below one in a hundred where light comes
// through a door or from windows that the camera hardly sees.
//
//   light_path_use SCENE [--algorithm spcbpt] [--iterations N] [--resolution WxH] [--set key=value ...]

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <tuple>

#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

int main(int argc, char** argv) {
    CLI::App app("Light sub-paths that come into sight");
    std::string scene_path, resolution, algorithm = "spcbpt";
    std::vector<std::string> set;
    uint32_t iterations = 4;
    app.add_option("scene", scene_path)->required();
    app.add_option("--algorithm", algorithm);
    app.add_option("--iterations", iterations)->check(CLI::Range(1u, 1000u));
    app.add_option("--resolution", resolution);
    app.add_option("--set", set);
    CLI11_PARSE(app, argc, argv);

    const bench::LoadedScene loaded = bench::load(scene_path, resolution);
    const RenderSettings settings = bench::settings_of(algorithm, set, loaded);
    TrainingReport training;
    const Tables tables = bench::value_or_exit(make_tables(*loaded.scene, settings, {}, &training));
    const auto renderer = bench::value_or_exit(Renderer::create(loaded.scene, settings, tables));
    const RenderUnit work = bench::whole_frame(*loaded.scene, settings.algorithm, iterations);
    // No two light sub-paths begin with the same edge.
    std::map<std::tuple<float, float, float, float, float, float>, double> light;
    const auto see = [&](const SeenContribution& seen) {
        if (!seen.found.technique.splats()) return;
        const Vec3 &a = seen.found.y[0].p, &b = seen.found.y[1].p;
        light[{a.x, a.y, a.z, b.x, b.y, b.z}] += double(scalar_of(seen.found.value)) * seen.weight;
    };
    bench::value_or_exit(renderer->watch(work, see, {}));
    double sum = 0, squares = 0;
    for (const auto& path : light) sum += path.second, squares += path.second * path.second;
    const double paths = double(work.light_path_count);
    std::printf("%s: %.2f %% of %.0f light sub-paths per iteration splat, %.1f effective ones\n", algorithm.c_str(),
                100 * double(light.size()) / paths, paths / iterations, squares > 0 ? sum * sum / squares / iterations : 0);
}
