#pragma once
// Follows the estimated error of a rendering (NoiseEstimate) beside its true error.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/progressive_render.h"
#include "common/import/import.h"
#include "common/metrics/metrics.h"

namespace lightloom::testing {

struct TrackedScene {
    std::shared_ptr<const Scene> scene;
    int max_depth = 0;
};

inline Result<TrackedScene> load_tracked(const std::string& path, int width, int height) {
    auto imported = import_pbrt(path);
    if (!imported.ok()) return imported.status();
    const int max_depth = imported->description.max_depth;
    auto scene = Scene::build(std::move(imported->description), {.width = width, .height = height});
    if (!scene.ok()) return scene.status();
    return TrackedScene{std::move(scene).value(), max_depth};
}

/// Renders `iterations` iterations; `at_group(render)` follows each group.
template <class AtGroup>
Result<client::ProgressiveRender> render_tracked(const TrackedScene& scene, const std::string& algorithm, uint64_t seed,
                                                 uint64_t iterations, const AtGroup& at_group) {
    const auto choice = client::parse_algorithm(algorithm);
    if (!choice.ok()) return choice.status();
    const RenderSettings settings{choice->settings, seed, scene.max_depth};
    const auto preparation = client::prepare(*scene.scene, settings, {});
    if (!preparation.ok()) return preparation.status();
    auto render = client::ProgressiveRender::start(scene.scene, settings, *preparation);
    while (render.ok() && render->iterations() < iterations) {
        LL_RETURN_IF_ERROR(render->advance(iterations));
        at_group(*render);
    }
    return render;
}

struct TrackedReference {
    RgbImage image;
    double relmse = 0;  ///< Estimated error of the reference itself.
};

inline Result<TrackedReference> make_tracked_reference(const TrackedScene& scene, const std::string& algorithm,
                                                       uint64_t iterations) {
    constexpr uint64_t kSeed = 1000003;  // of none of the measured runs
    const auto render = render_tracked(scene, algorithm, kSeed, iterations, [](const client::ProgressiveRender&) {});
    if (!render.ok()) return render.status();
    return TrackedReference{render->image(), render->noise() ? render->noise()->relmse : 0};
}

struct TrackedPoint {
    uint64_t iterations = 0;
    NoiseEstimate estimate;
    double relmse = 0;  ///< Against the reference, without the error of the reference.
    double ratio() const { return estimate.relmse / relmse; }
};

/// One point per octave, at `iterations` the last: at iterations, iterations / 2, ... or the group boundary after that.
inline Result<std::vector<TrackedPoint>> track_noise(const TrackedScene& scene, const TrackedReference& reference,
                                                     const std::string& algorithm, uint64_t seed, uint64_t iterations, int points) {
    std::vector<TrackedPoint> track;
    uint64_t next = iterations >> (points - 1);
    const auto render = render_tracked(scene, algorithm, seed, iterations, [&](const client::ProgressiveRender& r) {
        const auto estimate = r.noise();
        if (r.iterations() < next || !estimate) return;
        while (next <= r.iterations()) next *= 2;
        const auto metrics = compute_pixel_metrics(r.image(), reference.image);
        if (metrics.ok()) track.push_back({r.iterations(), *estimate, metrics->relmse - reference.relmse});
    });
    if (!render.ok()) return render.status();
    return track;
}

}  // namespace lightloom::testing
