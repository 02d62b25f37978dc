#pragma once
// The five ways to complete a path. Each function returns the unweighted contribution, black when the technique fails,
// and fills in the PathView of the full path. Visibility is tested here; the weight is computed elsewhere (mis.h).
//
// Camera sub-path z[0..t-1] (z_0 on the lens), light sub-path y[0..s-1]; the full path has k = s + t - 1 edges,
// x_i = y_i for i < s and x_{k-j} = z_j for j < t. The light vertices are PathVertex'es, or LightVertex'es of a cache.

#include "common/path/light_vertex.h"
#include "common/path/path_view.h"
#include "common/path/random_walk.h"

namespace lightloom {

/// Copies what a light prefix of s vertices knows of itself: all of fwd, and rev up to x_{s-3}.
template <class Vertex>
void view_light_prefix(const Vertex* y, int s, PathView* view) {
    for (int i = 0; i < s; ++i) {
        view->fwd[i] = y[i].fwd;
        view->rev[i] = y[i].rev;
        view->delta[i] = y[i].delta;
        view->lossless[i] = y[i].lossless;
    }
}

/// Copies what a camera suffix of t vertices knows of itself: all of rev, and fwd for x_{s+2} and later.
inline void view_camera_suffix(const PathVertex* z, int t, int k, PathView* view) {
    for (int j = 1; j < t; ++j) {
        view->rev[k - j] = z[j].fwd;
        view->fwd[k - j] = z[j].rev;
        view->delta[k - j] = z[j].delta;
        view->lossless[k - j] = z[j].lossless;
    }
}

/// Which entries of the PathView a caller's techniques read: all densities; only those of x_0 and x_1 (s = 0 and s = 1, where
/// filling in the rest would cost more than the weight); or all densities and what throughput.h needs of the technique's own
/// end vertices (start and step), for methods that select by the light's throughput.
enum class ViewDetail : uint8_t { kFull, kLightEnd, kSubspace };

/// Sets start[] of a path whose x_0, at `position`, lies on `e` and emits along `w`; fwd[0] must be set.
/// `direction_pdf` is that of EmitterSet::emission_densities().
inline void view_start(const EmitterSet& emitters, const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w,
                       float direction_pdf, PathView* view) {
    const float inv_position = float(1 / view->fwd[0]);
    view->start[0] = emitters.strength(e, position, w) * inv_position;
    const float cosine = e.is_area() ? abs_dot(normal, w) : 1;
    view->start[1] = direction_pdf > 0 ? emitters.emitted(e, position, normal, w) * (cosine * inv_position / direction_pdf) : Rgb{};
}

/// PathVertex::step of a camera vertex that a connection leaves towards the light along `w`.
inline Rgb light_step(const PathVertex& v, const Scatter& s, const Vec3& w) {
    const float factor = abs_dot(v.ng, v.wo) / (abs_dot(v.ng, w) * s.pdf_rev);
    return std::isfinite(factor) ? s.value * factor : Rgb{};
}

template <ViewDetail detail>
void view_suffix(const PathVertex* z, int t, int k, PathView* view) {
    if constexpr (detail != ViewDetail::kLightEnd) {
        view_camera_suffix(z, t, k, view);
    } else {
        for (int j = t - 1; j >= 1 && j >= t - 2; --j) {
            view->rev[k - j] = z[j].fwd;
            view->delta[k - j] = z[j].delta;
        }
    }
}

/// s = 0: the camera sub-path's last vertex z_{t-1} lies on an emitter. t >= 2.
template <ViewDetail detail = ViewDetail::kFull>
Rgb emitter_hit(const Scene& scene, const PathVertex* z, int t, PathView* view) {
    const PathVertex& v = z[t - 1];
    const EmitterSet& emitters = scene.emitters();
    const Emitter& e = emitters[uint32_t(v.emitter)];
    const Rgb radiance = emitters.emitted(e, v.p, v.ng, v.wo);
    if (radiance.is_black()) return {};
    const int k = t - 1;
    view->k = k;
    view_suffix<detail>(z, t, k, view);
    view->delta[0] = view->discrete_source = false;
    if (k == 1) {
        view->fwd[0] = emitters.pdf_position(e, v.p, v.wo);
    } else {
        const auto [position_pdf, direction_pdf] = emitters.emission_densities(e, v.p, v.ng, v.wo, z[t - 2].p);
        view->fwd[0] = position_pdf;
        if constexpr (detail == ViewDetail::kSubspace) view_start(emitters, e, v.p, v.ng, v.wo, direction_pdf, view);
        view->fwd[1] = double(direction_pdf) * v.to_previous;
        view->next_event = emitters.pdf_next_event(e, z[t - 2].p, v.p, v.ng, -v.wo);
    }
    return v.alpha * radiance;
}

/// s = 0, environment: the camera sub-path of t vertices leaves the scene along `ray`; x_0 is the direction.
template <ViewDetail detail = ViewDetail::kFull>
Rgb environment_hit(const Scene& scene, const PathVertex* z, int t, const WalkRay& ray, PathView* view) {
    const EmitterSet& emitters = scene.emitters();
    if (emitters.environment_index() == kNone) return {};
    const Emitter& e = emitters[uint32_t(emitters.environment_index())];
    const Rgb radiance = emitters.emitted(e, {}, {}, -ray.direction);
    if (radiance.is_black()) return {};
    const int k = t;
    view->k = k;
    view_suffix<detail>(z, t, k, view);
    view->delta[0] = view->discrete_source = false;
    view->rev[0] = ray.pdf;
    if (k == 1) {
        view->fwd[0] = emitters.pdf_position(e, {}, -ray.direction);
    } else {
        const auto [position_pdf, direction_pdf] = emitters.emission_densities(e, {}, {}, -ray.direction, z[t - 1].p);
        view->fwd[0] = position_pdf;
        if constexpr (detail == ViewDetail::kSubspace) view_start(emitters, e, {}, {}, -ray.direction, direction_pdf, view);
        view->fwd[1] = double(direction_pdf) * abs_dot(z[t - 1].ng, ray.direction);
        view->next_event = emitters.pdf_next_event(e, {}, {}, {}, ray.direction);
    }
    return ray.alpha * radiance;
}

/// s = 1: next event estimation from z_{t-1}, t >= 2, with x_0 = `light` chosen by EmitterSet::sample_next_event().
template <ViewDetail detail = ViewDetail::kFull>
Rgb next_event(const Scene& scene, const PathVertex* z, int t, const NextEventSample& light, PathView* view,
               WalkCounters* counters) {
    const PathVertex& v = z[t - 1];
    const EmitterSet& emitters = scene.emitters();
    const Scatter s = scatter<TransportMode::kRadiance>(v, light.wi);
    const Rgb contribution = v.alpha * s.value * light.radiance * (light.geometry / light.pdf);
    if (contribution.is_black()) return {};
    const Emitter& e = emitters[light.emitter];
    ++counters->rays;
    ++counters->connections;
    if (e.is_area() ? scene.occluded(v.p, v.ng, v.reach, light.position, light.normal, e.reach)
                    : scene.occluded(v.p, v.ng, v.reach, light.position, e.clearance))
        return {};
    const int k = t;
    view->k = k;
    view_suffix<detail>(z, t, k, view);
    view->delta[0] = view->delta[1] = false;
    view->discrete_source = e.is_discrete();
    view->rev[0] = e.can_be_hit() ? double(s.pdf_fwd) * light.geometry : 0.0;
    const auto [position_pdf, direction_pdf] = emitters.emission_densities(e, light.position, light.normal, -light.wi, v.p);
    view->fwd[0] = position_pdf;
    view->next_event = light.pdf;
    const float receiver = abs_dot(v.ng, light.wi);
    const float inv_d2 = e.is_infinite() ? 1.0f : 1 / length_squared(light.position - v.p);
    view->fwd[1] = double(direction_pdf) * (receiver * inv_d2);
    if constexpr (detail == ViewDetail::kSubspace) {
        view_start(emitters, e, light.position, light.normal, -light.wi, direction_pdf, view);
        view->step[1] = light_step(v, s, light.wi);
    }
    if (k >= 3) view->fwd[2] = double(s.pdf_rev) * v.to_previous;
    return contribution;
}

/// 2 <= s, 2 <= t: connects y_{s-1} and z_{t-1}.
template <ViewDetail detail = ViewDetail::kFull, class Vertex>
Rgb connect(const Scene& scene, const Vertex* y, int s, const PathVertex* z, int t, PathView* view, WalkCounters* counters) {
    const Vertex& a = y[s - 1];
    const PathVertex& b = z[t - 1];
    const Vec3 d = a.p - b.p;
    const float d2 = length_squared(d);
    if (!(d2 > 0)) return {};
    const float inv_d2 = 1 / d2;
    const Vec3 w = d * std::sqrt(inv_d2);  // from the camera side to the light side
    const Scatter at_camera = scatter<TransportMode::kRadiance>(b, w);
    if (at_camera.value.is_black()) return {};
    const Scatter at_light = scatter<TransportMode::kImportance>(a, -w);
    const Rgb contribution = b.alpha * at_camera.value * a.alpha * at_light.value * inv_d2;
    if (contribution.is_black()) return {};
    ++counters->rays;
    ++counters->connections;
    if (scene.occluded(b.p, b.ng, b.reach, a.p, a.ng, a.reach)) return {};
    const int k = s + t - 1;
    view->k = k;
    view_light_prefix(y, s, view);
    view_camera_suffix(z, t, k, view);
    view->delta[s - 1] = view->delta[s] = false;
    view->rev[s - 1] = double(at_camera.pdf_fwd) * (abs_dot(a.ng, w) * inv_d2);
    view->rev[s - 2] = double(at_light.pdf_rev) * a.to_previous;
    view->fwd[s] = double(at_light.pdf_fwd) * (abs_dot(b.ng, w) * inv_d2);
    if (t >= 3) view->fwd[s + 1] = double(at_camera.pdf_rev) * b.to_previous;
    if constexpr (detail == ViewDetail::kSubspace) {
        view->step[s - 1] = at_light.pdf_fwd > 0 ? at_light.value / at_light.pdf_fwd : Rgb{};
        view->step[s] = light_step(b, at_camera, w);
    }
    // Next event would have chosen x_0 from x_1; both are on the light sub-path.
    const Emitter& e = scene.emitters()[uint32_t(y[0].emitter)];
    view->discrete_source = e.is_discrete();
    view->next_event = scene.emitters().pdf_next_event(e, y[1].p, y[0].p, y[0].ng, y[1].wo);
    return contribution;
}

/// t = 1: connects y_{s-1}, s >= 2, to `lens_point` of Camera::sample_lens(), which Camera::see() may move. `film`
/// receives the film position.
inline Rgb connect_to_camera(const Scene& scene, const PathVertex* y, int s, Vec3* lens_point, Vec2* film, PathView* view,
                             WalkCounters* counters) {
    const PathVertex& a = y[s - 1];
    Camera::Sight sight;
    if (!scene.camera().see(a.p, lens_point, &sight)) return {};
    *film = sight.film;
    const Vec3& w = sight.direction;
    const float pdf = sight.pdf, d2 = sight.distance2;
    const Rect& crop = scene.frame().crop;
    if (!crop.contains(int(film->x), int(film->y))) return {};
    const Scatter at_light = scatter<TransportMode::kImportance>(a, -w);
    // The camera's We cos / d^2 equals its density of the direction, by the measure convention of camera.h.
    const Rgb contribution = a.alpha * at_light.value * (pdf / d2);
    if (contribution.is_black()) return {};
    ++counters->rays;
    ++counters->connections;
    if (scene.occluded(a.p, a.ng, a.reach, *lens_point, scene.camera_clearance())) return {};
    const int k = s;
    view->k = k;
    view_light_prefix(y, s, view);
    view->delta[s - 1] = false;
    view->rev[s - 1] = double(pdf) * (abs_dot(a.ng, w) / d2);
    view->rev[s - 2] = double(at_light.pdf_rev) * a.to_previous;
    const Emitter& e = scene.emitters()[uint32_t(y[0].emitter)];
    view->discrete_source = e.is_discrete();
    view->next_event = scene.emitters().pdf_next_event(e, y[1].p, y[0].p, y[0].ng, y[1].wo);
    return contribution;
}

/// 2 <= s, 2 <= t: y_{s-1} and z_{t-1} lie next to one another and count as one vertex x_i of a path of k = s + t - 2 edges,
/// i = s - 1, scattered by the material and with the frame that z_{t-1} has. Returns the contribution without the kernel, m^2:
/// the flux of the light sub-path times what the camera sub-path makes of the irradiance of one watt per square metre.
template <ViewDetail detail = ViewDetail::kFull, class Vertex>
Rgb merge(const Scene& scene, const Vertex* y, int s, const PathVertex* z, int t, PathView* view) {
    const Vertex& a = y[s - 1];
    const PathVertex& b = z[t - 1];
    const Vec3 wi = b.shading.to_local(a.wo);
    const float arriving = abs_dot(a.ng, a.wo);
    if (!(arriving > 0)) return {};
    const BsdfEval e = b.bsdf.eval(b.wo_local, wi, TransportMode::kRadiance);
    // The light sub-path's flux per area has the geometric cosine of the facet on which it arrived, the camera's scattering the
    // shading one. That of the camera's facet would not cancel where the two differ, and could be 0 where the others are not.
    const Rgb contribution = b.alpha * e.f * a.alpha * (std::fabs(wi.z) / arriving);
    if (contribution.is_black()) return {};
    const int i = s - 1, k = s + t - 2;
    view->k = k;
    view_light_prefix(y, s, view);
    view_camera_suffix(z, t, k, view);
    view->delta[i] = false;
    view->fwd[i] = a.fwd;
    view->rev[i - 1] = double(e.pdf_fwd) * a.to_previous;
    if (t >= 3) view->fwd[i + 1] = double(e.pdf_rev) * b.to_previous;
    if constexpr (detail == ViewDetail::kSubspace) {
        view->step[i] = light_step(b, {e.f * std::fabs(wi.z), e.pdf_fwd, e.pdf_rev}, a.wo);
        // Beyond the merge the camera knows the steps; as a technique's own end vertex this one is read in the view.
        if (t >= 3) view->step[i + 1] = z[t - 2].step;
    }
    const Emitter& emitter = scene.emitters()[uint32_t(y[0].emitter)];
    view->discrete_source = emitter.is_discrete();
    view->next_event = scene.emitters().pdf_next_event(emitter, y[1].p, y[0].p, y[0].ng, y[1].wo);
    return contribution;
}

}  // namespace lightloom
