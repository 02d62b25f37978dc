#pragma once
// Interprets the benchmarks' command lines. Errors are printed and end the program with exit code 2.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/import/import.h"
#include "common/scene/scene.h"
#include "common/transport/renderer.h"

namespace lightloom::bench {

template <class T>
T value_or_exit(Result<T> result) {
    if (result.ok()) return *std::move(result);
    std::fprintf(stderr, "%s\n", result.status().message().c_str());
    std::exit(2);
}

struct LoadedScene {
    std::shared_ptr<const Scene> scene;
    int max_depth = 0;
};

/// Loads a scene; `resolution` is "WxH", or empty for the scene's.
inline LoadedScene load(const std::string& path, const std::string& resolution) {
    ImportedScene imported = value_or_exit(import_pbrt(path));
    SceneOptions options;
    if (!resolution.empty() && std::sscanf(resolution.c_str(), "%dx%d", &options.width, &options.height) != 2) {
        std::fprintf(stderr, "--resolution takes WIDTHxHEIGHT, not \"%s\"\n", resolution.c_str());
        std::exit(2);
    }
    const int max_depth = imported.description.max_depth;
    return {value_or_exit(Scene::build(std::move(imported.description), options)), max_depth};
}

/// Settings of an algorithm; each item of `set` is "key=value".
inline RenderSettings settings_of(const std::string& algorithm, const std::vector<std::string>& set, const LoadedScene& loaded) {
    std::map<std::string, std::string> parameters;
    for (const std::string& item : set) {
        const size_t equals = std::min(item.find('='), item.size());
        parameters[item.substr(0, equals)] = equals < item.size() ? item.substr(equals + 1) : "";
    }
    return {value_or_exit(AlgorithmSettings::parse(algorithm, parameters)), 1, loaded.max_depth};
}

/// A unit of the whole frame, with the light paths that its plan would give it.
inline RenderUnit whole_frame(const Scene& scene, const AlgorithmSettings& algorithm, uint32_t iterations) {
    const Rect& crop = scene.frame().crop;
    return {.iteration_count = iterations,
            .tile = crop,
            .light_path_count = iterations * algorithm.light_paths_per_iteration(crop.area()),
            .splats_only = !algorithm.info().camera_samples};
}

}  // namespace lightloom::bench
