#pragma once
// Rebuilds a full path under any technique through the production code: the result is what a technique would have known
// if it had made this very path. This is used to show that PathViews agree and that weights sum to one.

#include <optional>
#include <vector>

#include "common/path/connect.h"
#include "common/path/mis.h"
#include "common/transport/light_cache.h"
#include "common/transport/renderer.h"

namespace lightloom::testing {

/// A full path: x_0 .. x_{k-1} (x_k is the lens point), and for infinite lights the direction of travel.
struct FullPath {
    std::vector<PathVertex> x;  ///< k vertices; x[0] may be a bare emitter endpoint (with ng and emitter).
    Vec3 lens;
    bool infinite = false;  ///< x[0] is a direction: x[0].ng is the direction of travel.
    int k() const { return int(x.size()); }
};

inline FullPath join(const Scene& scene, const PathVertex* y, int s, const PathVertex* z, int t) {
    FullPath path;
    for (int i = 0; i < s; ++i) path.x.push_back(y[i]);
    for (int j = t - 1; j >= 1; --j) path.x.push_back(z[j]);
    path.lens = z[0].p;
    path.infinite = scene.emitters()[uint32_t(path.x[0].emitter)].is_infinite();
    // Only interior events can be Dirac; ends of the connection are not.
    if (s >= 1) path.x[size_t(s - 1)].delta = false;
    if (s < path.k()) path.x[size_t(s)].delta = false;
    path.x[0].delta = false;
    return path;
}

inline SurfacePoint point_of(const PathVertex& v) {
    SurfacePoint p;
    p.p = v.p, p.ng = v.ng, p.shading = v.shading, p.emitter = v.emitter, p.reach = v.reach;
    return p;
}

/// Makes vertex `v` scatter towards `w` (the event that the path has there) and prepares the ray; mirrors leave().
template <TransportMode mode>
bool leave_towards(PathVertex* v, PathVertex* previous, const Vec3& w, bool delta, WalkRay* ray) {
    const Vec3 wi = v->shading.to_local(w);
    ray->direction = w;
    if (delta) {
        bool found = false;
        for (int i = 0; i < 256 && !found; ++i) {
            BsdfSample s;
            if (!v->bsdf.sample(v->wo_local, (float(i) + 0.5f) / 256, {0.5f, 0.5f}, mode, &s) || !s.delta) continue;
            if (length_squared(s.wi - wi) > 1e-4f) continue;
            ray->pdf = s.pdf_fwd;
            previous->rev = double(s.pdf_rev) * v->to_previous;
            Rgb weight = s.weight;
            if (mode == TransportMode::kImportance)
                weight *= v->adjoint * abs_dot(w, v->ng) / std::fabs(s.wi.z);
            else
                v->step = light_step(*v, s, w);
            ray->alpha = v->alpha * weight;
            found = true;
        }
        if (!found) return false;
    } else {
        const BsdfEval e = v->bsdf.eval(v->wo_local, wi, mode);
        if (!(e.pdf_fwd > 0)) return false;
        ray->pdf = e.pdf_fwd;
        previous->rev = double(e.pdf_rev) * v->to_previous;
        const Scatter s = scatter<mode>(*v, w);
        ray->alpha = v->alpha * s.value / e.pdf_fwd;
        if (mode == TransportMode::kRadiance) {
            BsdfSample sampled;
            sampled.wi = wi;
            sampled.weight = s.value / e.pdf_fwd;
            sampled.pdf_fwd = e.pdf_fwd, sampled.pdf_rev = e.pdf_rev;
            sampled.delta = false;
            v->step = light_step(*v, sampled, w);
        }
    }
    v->delta = delta;
    ray->from_infinite = false;
    ray->previous_hittable = true;
    return true;
}

/// The light sub-path of the first s vertices, as light tracing would have made it; nothing if it cannot make it.
inline std::optional<std::vector<PathVertex>> rebuild_light(const Scene& scene, const FullPath& path, int s) {
    std::vector<PathVertex> y;
    const EmitterSet& emitters = scene.emitters();
    const Emitter& e = emitters[uint32_t(path.x[0].emitter)];
    const Vec3 first = path.infinite ? path.x[0].ng : normalize(path.x[1].p - path.x[0].p);
    PathVertex y0 = path.x[0];
    if (!path.infinite && !e.is_area()) y0.ng = first;
    const Vec3 x1 = path.x.size() > 1 ? path.x[1].p : y0.p;
    const EmissionDensities densities = emitters.emission_densities(e, y0.p, y0.ng, first, x1);
    y0.fwd = densities.position;
    y0.rev = 0;
    WalkRay ray;
    ray.direction = first;
    ray.pdf = densities.direction;
    if (!(y0.fwd > 0 && ray.pdf > 0)) return std::nullopt;
    ray.from_infinite = e.is_infinite();
    ray.previous_hittable = e.can_be_hit();
    const float cosine = e.is_area() ? abs_dot(y0.ng, first) : 1;
    ray.alpha = emitters.emitted(e, y0.p, y0.ng, first) * (cosine / float(y0.fwd * ray.pdf));
    y0.alpha = emitters.strength(e, y0.p, first) / float(y0.fwd);
    y0.survival = 1;
    y0.label = y0.reverse_label = kNoLabel;
    y0.reverse_branch = 0;
    y.push_back(y0);
    for (int i = 1; i < s; ++i) {
        PathVertex v;
        arrive<TransportMode::kImportance>(ray, y.back().p, y.back().ng, i > 1 || e.is_area(), point_of(path.x[size_t(i)]), &v);
        v.set_bsdf(path.x[size_t(i)].bsdf);
        y.push_back(v);
        if (i + 1 == s) break;
        const Vec3 w = normalize(path.x[size_t(i + 1)].p - path.x[size_t(i)].p);
        if (!leave_towards<TransportMode::kImportance>(&y[size_t(i)], &y[size_t(i - 1)], w, path.x[size_t(i)].delta, &ray))
            return std::nullopt;
    }
    return y;
}

/// The camera sub-path of t vertices (lens included). `escape` receives the ray leaving the last one when `leaves` is set
/// (towards an infinite x_0).
inline std::optional<std::vector<PathVertex>> rebuild_camera(const Scene& scene, const FullPath& path, int t, WalkRay* escape,
                                                             bool leaves) {
    const int k = path.k();
    const Vec3 first = normalize(path.x[size_t(k - 1)].p - path.lens);
    Vec2 film;
    float pdf = 0;
    if (!scene.camera().project(path.lens, first, &film, &pdf)) return std::nullopt;
    std::vector<PathVertex> z(1);
    z[0].p = path.lens;
    z[0].alpha = Rgb(1.0f);
    WalkRay ray{path.lens, first, Rgb(1.0f), pdf, scene.camera().has_parallel_rays()};
    for (int j = 1; j < t; ++j) {
        const PathVertex& x = path.x[size_t(k - j)];
        PathVertex v;
        arrive<TransportMode::kRadiance>(ray, z.back().p, z.back().ng, j > 1, point_of(x), &v);
        v.set_bsdf(x.bsdf);
        z.push_back(v);
        const bool last = j + 1 == t;
        if (last && !leaves) break;
        const Vec3 w = last ? -path.x[0].ng : normalize(path.x[size_t(k - j - 1)].p - x.p);
        if (!leave_towards<TransportMode::kRadiance>(&z[size_t(j)], &z[size_t(j - 1)], w, x.delta, &ray)) return std::nullopt;
    }
    if (escape != nullptr) *escape = ray;
    return z;
}

struct Rebuilt {
    Rgb contribution;  ///< Unweighted.
    PathView view;
};

/// The path as a technique would have produced it; nothing when that technique cannot. With `weights`, it is as that
/// algorithm would have produced it, and the view has what the algorithm adds.
inline std::optional<Rebuilt> rebuild(const Scene& scene, const FullPath& path, Technique technique,
                                      const PathWeights* weights = nullptr) {
    const int k = path.k(), s = technique.s;
    const Emitter& e = scene.emitters()[uint32_t(path.x[0].emitter)];
    const auto smooth = [&](int i) { return !path.x[size_t(i)].delta && path.x[size_t(i)].bsdf.has_smooth_lobe(); };
    Rebuilt r;
    WalkCounters counters;
    std::optional<std::vector<PathVertex>> y, z;
    const int t = k + 1 - s;
    Vec3 towards;  // from z_{t-1} to x_{s-1}
    switch (technique.kind) {
        case TechniqueKind::kHit: {
            if (!e.can_be_hit()) return std::nullopt;
            WalkRay ray;
            z = rebuild_camera(scene, path, path.infinite ? k : k + 1, &ray, path.infinite);
            if (!z) return std::nullopt;
            towards = ray.direction;
            r.contribution = path.infinite ? environment_hit<ViewDetail::kSubspace>(scene, z->data(), k, ray, &r.view)
                                           : emitter_hit<ViewDetail::kSubspace>(scene, z->data(), k + 1, &r.view);
            break;
        }
        case TechniqueKind::kNextEvent: {
            if (k < 2 || !smooth(1)) return std::nullopt;
            z = rebuild_camera(scene, path, k, nullptr, false);
            if (!z) return std::nullopt;
            const PathVertex& ref = z->back();
            NextEventSample light;
            light.emitter = uint32_t(path.x[0].emitter);
            light.wi = towards = path.infinite ? -path.x[0].ng : normalize(path.x[0].p - ref.p);
            light.position = path.infinite ? ref.p + light.wi * (2 * scene.emitters().scene_radius()) : path.x[0].p;
            light.normal = e.is_area() ? path.x[0].ng : -light.wi;
            light.radiance = scene.emitters().emitted(e, light.position, light.normal, -light.wi);
            light.geometry = e.is_infinite()
                                 ? 1.0f
                                 : (e.is_area() ? abs_dot(light.normal, light.wi) : 1.0f) / length_squared(light.position - ref.p);
            light.pdf = scene.emitters().pdf_next_event(e, ref.p, light.position, light.normal, light.wi);
            if (!(light.pdf > 0)) return std::nullopt;
            r.contribution = next_event<ViewDetail::kSubspace>(scene, z->data(), k, light, &r.view, &counters);
            y = rebuild_light(scene, path, 1);
            if (!y) return std::nullopt;
            break;
        }
        case TechniqueKind::kConnect: {
            if (s < 1 || s >= k || !smooth(s) || (s > 1 && !smooth(s - 1))) return std::nullopt;
            y = rebuild_light(scene, path, s);
            z = rebuild_camera(scene, path, t, nullptr, false);
            if (!y || !z) return std::nullopt;
            towards = s == 1 && path.infinite ? -path.x[0].ng : normalize(y->back().p - z->back().p);
            r.contribution = connect_candidate<ViewDetail::kSubspace>(scene, y->data(), s, z->data(), t, &r.view, &counters);
            break;
        }
        case TechniqueKind::kLens: {
            if (k < 2 || !smooth(k - 1)) return std::nullopt;
            y = rebuild_light(scene, path, k);
            if (!y) return std::nullopt;
            z.emplace(1);
            (*z)[0].p = path.lens;
            towards = normalize(y->back().p - path.lens);
            Vec2 film;
            r.contribution = connect_to_camera(scene, y->data(), k, &(*z)[0].p, &film, &r.view, &counters);
            break;
        }
        case TechniqueKind::kMerge: {
            if (s < 1 || s >= k || !smooth(s)) return std::nullopt;
            y = rebuild_light(scene, path, s + 1);
            z = rebuild_camera(scene, path, k + 1 - s, nullptr, false);
            if (!y || !z) return std::nullopt;
            r.contribution = merge<ViewDetail::kSubspace>(scene, y->data(), s + 1, z->data(), k + 1 - s, &r.view);
            break;
        }
    }
    if (r.contribution.is_black()) return std::nullopt;
    if (weights != nullptr && k >= 2) {
        if (y) weights->label_light_path(scene, y->data(), int(y->size()));
        for (size_t j = 1; j < z->size(); ++j)
            if ((*z)[j].bsdf.has_smooth_lobe()) weights->label_camera_vertex(scene, &(*z)[j]);
        const int light_vertices = y ? int(y->size()) : 0;
        weights->complete(scene, y ? y->data() : nullptr, light_vertices, z->data(), int(z->size()), towards, &r.view);
    }
    return r;
}

/// Calls visit(technique) for every technique that could have made a path of k edges, whether or not an algorithm has
/// it.
template <class Visit>
void for_each_technique(int k, Visit&& visit) {
    for (int s = 0; s <= k; ++s) for_each_technique_of_split(s, k, visit);
    for (int i = 1; i < k; ++i) visit(Technique::merge(i));
}

}  // namespace lightloom::testing
