#pragma once
// Random full paths of a scene, one stream per technique.

#include <functional>

#include "common/path/camera_walk.h"
#include "tests/support/path_rebuild.h"

namespace lightloom::testing {

/// Traces `count` camera and light sub-paths and calls visit(path, technique, view, contribution) for every full path that a
/// technique completes with a non-black contribution; `view` is the one that the technique filled in, with what the algorithm of
/// `weights` adds. Points on lights are chosen afresh and also taken from light sub-paths.
inline void for_each_path(const Scene& scene, int count, int max_edges, uint64_t seed,
                          const std::function<void(const FullPath&, Technique, const PathView&, const Rgb&)>& visit,
                          const PathWeights* weights = nullptr) {
    constexpr ViewDetail kDetail = ViewDetail::kSubspace;
    std::vector<PathVertex> y(size_t(max_edges) + 2), z(size_t(max_edges) + 3);
    const Rect crop = scene.frame().crop;
    // The rule is harsher than the default, so that weights that depend on what roulette did to the path would be found
    // out.
    const RouletteRule rule{.min_survival = 0.05f};
    WalkCounters counters;
    PathView view;
    const auto complete = [&](const PathVertex* light, int s, PathVertex* camera, int t, const Vec3& towards) {
        if (weights != nullptr && view.k >= 2) weights->complete(scene, light, s, camera, t, towards, &view);
    };
    for (int i = 0; i < count; ++i) {
        LightSampler light_sampler({seed, Stage::kLight, 0, uint64_t(i)});
        Rng& rng = light_sampler.rng();
        const int n = trace_light_path(scene, light_sampler, max_edges, rule, y.data(), &counters);
        if (weights != nullptr) weights->label_light_path(scene, y.data(), n);
        for (int s = 2; s <= n; ++s) {
            if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
            Vec2 film;
            Vec3 lens = scene.camera().sample_lens(rng.uniform2());
            const Rgb c = connect_to_camera(scene, y.data(), s, &lens, &film, &view, &counters);
            if (c.is_black()) continue;
            PathVertex z0;
            z0.p = lens;
            complete(y.data(), s, &z0, 1, normalize(y[size_t(s - 1)].p - lens));
            visit(join(scene, y.data(), s, &z0, 1), Technique::lens(s), view, c);
        }
        CameraSampler sampler(seed, uint64_t(i), uint64_t(i));
        const int px = crop.x0 + int(rng.below(uint32_t(crop.width()))), py = crop.y0 + int(rng.below(uint32_t(crop.height())));
        const auto on_vertex = [&](int t) {
            const PathVertex& v = z[size_t(t - 1)];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit<kDetail>(scene, z.data(), t, &view); !c.is_black()) {
                    complete(nullptr, 0, z.data(), t, {});
                    visit(join(scene, nullptr, 0, z.data(), t), Technique::hit(), view, c);
                }
            if (t > max_edges || !v.bsdf.has_smooth_lobe()) return;
            if (weights != nullptr) weights->label_camera_vertex(scene, &z[size_t(t - 1)]);
            const auto towards = [&](const PathVertex& y0) {
                return scene.emitters()[uint32_t(y0.emitter)].is_infinite() ? -y0.ng : normalize(y0.p - v.p);
            };
            if (n > 0)
                if (const Rgb c = connect_candidate<kDetail>(scene, y.data(), 1, z.data(), t, &view, &counters); !c.is_black()) {
                    complete(y.data(), 1, z.data(), t, towards(y[0]));
                    visit(join(scene, y.data(), 1, z.data(), t), Technique::connect(1), view, c);
                }
            NextEventSample light;
            if (scene.emitters().sample_next_event(v.p, rng.uniform_double(), rng.uniform2(), &light))
                if (const Rgb c = next_event<kDetail>(scene, z.data(), t, light, &view, &counters); !c.is_black()) {
                    PathVertex y0;
                    y0.p = light.position, y0.ng = light.normal, y0.emitter = int32_t(light.emitter);
                    if (weights != nullptr) weights->label_light_path(scene, &y0, 1);
                    complete(&y0, 1, z.data(), t, towards(y0));
                    visit(join(scene, &y0, 1, z.data(), t), Technique::next_event(), view, c);
                }
            for (int s = 2; s <= n && s + t - 1 <= max_edges; ++s) {
                if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                if (const Rgb c = connect<kDetail>(scene, y.data(), s, z.data(), t, &view, &counters); !c.is_black()) {
                    complete(y.data(), s, z.data(), t, normalize(y[size_t(s - 1)].p - v.p));
                    visit(join(scene, y.data(), s, z.data(), t), Technique::connect(s), view, c);
                }
            }
        };
        const auto on_escape = [&](int t, const WalkRay& ray) {
            if (t > max_edges) return;
            const Rgb c = environment_hit<kDetail>(scene, z.data(), t, ray, &view);
            if (c.is_black()) return;
            complete(nullptr, 0, z.data(), t, ray.direction);
            PathVertex y0;
            y0.ng = -ray.direction, y0.emitter = scene.emitters().environment_index();
            y0.p = z[size_t(t - 1)].p + ray.direction * scene.emitters().scene_radius();
            visit(join(scene, &y0, 1, z.data(), t), Technique::hit(), view, c);
        };
        trace_camera_path(scene, sampler, px, py, max_edges, rule, z.data(), &counters, on_vertex, on_escape);
    }
}

}  // namespace lightloom::testing
