#pragma once
// Random full paths of a scene, one stream per technique.

#include <functional>

#include "common/path/camera_walk.h"
#include "tests/support/path_rebuild.h"

namespace lightloom::testing {

/// Traces `count` camera and light sub-paths and calls visit(path, s, view) for every full path that a technique
/// completes with a non-black contribution; `view` is the one that the technique filled in. With a labeller: as a method that
/// selects by subspaces does it, see rebuild().
inline void for_each_path(const Scene& scene, int count, int max_edges, uint64_t seed,
                          const std::function<void(const FullPath&, int, const PathView&, const Rgb&)>& visit,
                          const SubspaceLabeller* labeller = nullptr) {
    constexpr ViewDetail kDetail = ViewDetail::kSubspace;
    std::vector<PathVertex> y(size_t(max_edges) + 2), z(size_t(max_edges) + 3);
    const Rect crop = scene.frame().crop;
    // Harsher than the default, so that weights which saw what roulette did to the path would be found out.
    const RouletteRule rule{.min_survival = 0.05f};
    WalkCounters counters;
    PathView view;
    const auto complete = [&](const PathVertex* light, int s, PathVertex* camera, int t, const Vec3& towards) {
        if (labeller != nullptr && view.k >= 2) labeller->complete(light, s, camera, t, towards, &view);
    };
    for (int i = 0; i < count; ++i) {
        LightSampler light_sampler({seed, Stage::kLight, 0, uint64_t(i)});
        Rng& rng = light_sampler.rng();
        const int n = trace_light_path(scene, light_sampler, max_edges, rule, y.data(), &counters);
        if (labeller != nullptr) labeller->label_light_path(y.data(), n);
        for (int s = 2; s <= n; ++s) {
            if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
            Vec2 film;
            const Vec3 lens = scene.camera().sample_lens(rng.uniform2());
            const Rgb c = connect_to_camera(scene, y.data(), s, lens, &film, &view, &counters);
            if (c.is_black()) continue;
            PathVertex z0;
            z0.p = lens;
            complete(y.data(), s, &z0, 1, normalize(y[size_t(s - 1)].p - lens));
            visit(join(scene, y.data(), s, &z0, 1), s, view, c);
        }
        CameraSampler sampler(seed, uint64_t(i), uint64_t(i));
        const int px = crop.x0 + int(rng.below(uint32_t(crop.width()))), py = crop.y0 + int(rng.below(uint32_t(crop.height())));
        const auto on_vertex = [&](int t) {
            const PathVertex& v = z[size_t(t - 1)];
            if (v.emitter != kNone)
                if (const Rgb c = emitter_hit<kDetail>(scene, z.data(), t, &view); !c.is_black()) {
                    complete(nullptr, 0, z.data(), t, {});
                    visit(join(scene, nullptr, 0, z.data(), t), 0, view, c);
                }
            if (t > max_edges || !v.bsdf.has_smooth_lobe()) return;
            NextEventSample light;
            if (labeller != nullptr) {
                labeller->label_camera_vertex(&z[size_t(t - 1)]);
                if (n > 0)
                    if (const Rgb c = connect_candidate<kDetail>(scene, y.data(), 1, z.data(), t, &view, &counters);
                        !c.is_black()) {
                        const bool infinite = scene.emitters()[uint32_t(y[0].emitter)].is_infinite();
                        complete(y.data(), 1, z.data(), t, infinite ? -y[0].ng : normalize(y[0].p - v.p));
                        visit(join(scene, y.data(), 1, z.data(), t), 1, view, c);
                    }
            } else if (scene.emitters().sample_next_event(v.p, rng.uniform_double(), rng.uniform2(), &light)) {
                if (const Rgb c = next_event<kDetail>(scene, z.data(), t, light, &view, &counters); !c.is_black()) {
                    PathVertex y0;
                    y0.p = light.position, y0.ng = light.normal, y0.emitter = int32_t(light.emitter);
                    visit(join(scene, &y0, 1, z.data(), t), 1, view, c);
                }
            }
            for (int s = 2; s <= n && s + t - 1 <= max_edges; ++s) {
                if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                if (const Rgb c = connect<kDetail>(scene, y.data(), s, z.data(), t, &view, &counters); !c.is_black()) {
                    complete(y.data(), s, z.data(), t, normalize(y[size_t(s - 1)].p - v.p));
                    visit(join(scene, y.data(), s, z.data(), t), s, view, c);
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
            visit(join(scene, &y0, 1, z.data(), t), 0, view, c);
        };
        trace_camera_path(scene, sampler, px, py, max_edges, rule, z.data(), &counters, on_vertex, on_escape);
    }
}

}  // namespace lightloom::testing
