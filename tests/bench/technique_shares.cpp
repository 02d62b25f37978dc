// Shows where an image's light and an algorithm's noise come from, for several algorithms and with any parameters
// (client/bench/technique_shares.h says what is measured).
//
//   technique_shares SCENE [--algorithms bdpt,lvcbpt,spcbpt] [--iterations N] [--seeds N] [--resolution WxH]
//                    [--set key=value ...]

#include "client/bench/technique_shares.h"

#include <CLI/CLI.hpp>
#include <cstdio>

#include "common/transport/training.h"
#include "tests/bench/bench_scene.h"

using namespace lightloom;

int main(int argc, char** argv) {
    CLI::App app("Shares of techniques in an image's light and noise");
    std::string scene_path, resolution;
    std::vector<std::string> algorithms{"bdpt", "lvcbpt", "spcbpt"}, set;
    uint32_t iterations = 8, seeds = 8;
    app.add_option("scene", scene_path)->required();
    app.add_option("--algorithms", algorithms)->delimiter(',');
    app.add_option("--iterations", iterations);
    app.add_option("--seeds", seeds)->check(CLI::Range(2u, 1000u));
    app.add_option("--resolution", resolution);
    app.add_option("--set", set);
    CLI11_PARSE(app, argc, argv);

    const bench::LoadedScene loaded = bench::load(scene_path, resolution);
    for (const std::string& name : algorithms) {
        const RenderSettings settings = bench::settings_of(name, set, loaded);
        TrainingReport training;
        const Tables tables = bench::value_or_exit(make_tables(*loaded.scene, settings, {}, &training));
        const client::TechniqueShares shares =
            bench::value_or_exit(client::technique_shares(loaded.scene, settings, tables, iterations, seeds, {}));
        std::printf("%s, %u x %u iterations: relative variance of a pixel per iteration %.3g\n", name.c_str(), shares.seeds,
                    shares.iterations, shares.relative_variance);
        std::printf("  %-14s %9s %9s\n", "", "light", "noise");
        for (const client::TechniqueShare& share : shares.classes)
            std::printf("  %-14s %8.2f%% %8.2f%%\n", std::string(share.name).c_str(), 100 * share.light, 100 * share.noise);
    }
}
