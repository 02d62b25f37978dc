#pragma once
// The camera sub-path: where samples of a pixel are placed, and the walk from the lens.

#include "common/path/connect.h"
#include "common/path/walk_sampler.h"

namespace lightloom {

/// Random numbers of one camera sample: keyed by (seed, iteration, pixel). The film position, the lens and the first
/// scattering and next event come from low-discrepancy sequences over the iterations of a pixel; the rest is independent.
class CameraSampler : public WalkSampler {
  public:
    CameraSampler(uint64_t seed, uint64_t iteration, uint64_t pixel)
        : WalkSampler({seed, Stage::kCamera, iteration, pixel}, Rng({seed, Stage::kPixelScramble, 0, pixel}).next_u64(),
                      uint32_t(iteration), 2) {}

    /// The ray of the sample through the pixel (px, py).
    Camera::CameraRay ray(const Camera& camera, int px, int py) const {
        const Vec2 film = point(0), lens = camera.has_lens() ? point(1) : Vec2{};
        return camera.sample_ray({float(px) + film.x, float(py) + film.y}, lens);
    }
    Vec2 next_event(int t) { return t == 2 ? point(3) : rng().uniform2(); }
    /// For draws of light sub-paths to connect to.
    Vec2 connection(int t) { return t == 2 ? point(4) : rng().uniform2(); }
};

/// Walks from the lens along sampler.ray(). `z` has room for max_edges + 2 vertices. After each arrival `visit(t)` is
/// called with z[0 .. t-1] complete (material resolved unless nothing can follow), before the vertex scatters: the
/// callback is the place for next event estimation and emitter hits. `escape(t, ray)` is called when the sub-path of t
/// vertices leaves the scene. Returns the number of vertices.
template <class Visit, class Escape>
int trace_camera_path(const Scene& scene, CameraSampler& sampler, int px, int py, int max_edges, const RouletteRule& rule,
                      PathVertex* z, WalkCounters* counters, Visit&& visit, Escape&& escape) {
    const Camera::CameraRay lens_ray = sampler.ray(scene.camera(), px, py);
    WalkRay ray{.origin = lens_ray.origin,
                .direction = lens_ray.direction,
                .alpha = Rgb(1.0f),
                .pdf = lens_ray.pdf,
                .from_infinite = scene.camera().has_parallel_rays(),
                .clearance = scene.camera_clearance()};
    z[0].p = ray.origin;
    z[0].alpha = ray.alpha;
    z[0].delta = false;
    int t = 1;
    while (true) {
        SurfacePoint point;
        ++counters->rays;
        if (!scene.intersect(ray.origin, ray.direction, &point, ray.clearance)) {
            escape(t, ray);
            break;
        }
        PathVertex& v = z[t];
        arrive<TransportMode::kRadiance>(ray, z[t - 1].p, z[t - 1].ng, t > 1, point, &v);
        if (!(v.fwd > 0) || !std::isfinite(v.fwd)) break;
        ++t;
        ++counters->vertices;
        if (t > max_edges) {  // only an emitter hit can still be counted: k = t - 1
            v.bsdf.kind = BsdfKind::kNull;
            visit(t);
            break;
        }
        v.set_bsdf(scene.bsdf_at(point));
        visit(t);
        if (!leave<TransportMode::kRadiance>(&v, &z[t - 2], sampler.scattering(t), &ray)) break;
        if (!survive(rule, t, 1.0f, sampler.roulette(), &ray)) break;
    }
    return t;
}

}  // namespace lightloom
