#include "common/scene/emitter.h"

#include <cmath>

#include "common/core/math.h"

namespace lightloom {
namespace {

/// 1 - cos of the angle between unit vectors, without cancellation.
float height_between(const Vec3& a, const Vec3& b) { return 0.5f * length_squared(a - b); }

float spot_falloff(const Emitter& e, const Vec3& w) {
    const float height = height_between(e.normal, w);
    if (height > e.total_height) return 0;
    if (height <= e.falloff_height) return 1;
    const float x = (e.total_height - height) / (e.total_height - e.falloff_height);
    return x * x * (3 - 2 * x);
}

/// 1 - cos of the half angle under which a sphere is seen from distance^2 `d2`, without cancellation.
float cone_height(float radius, float d2) {
    const float sin2 = radius * radius / d2;
    return sin2 / (1 + safe_sqrt(1 - sin2));
}

/// Whether next event estimation samples the sphere by the cone that it subtends (otherwise by area). It does so from
/// outside, if only the near side can shine there: the inner face of the far side shines through a hidden near side.
bool samples_cone(const Emitter& e, float d2) {
    return !e.inward && !(e.hidden && e.two_sided) && d2 > e.radius * e.radius * 1.0001f;
}

}  // namespace

EmitterSet::EmitterSet(std::vector<Emitter> emitters, Environment environment, Vec3 centre, float radius, LightMaps maps)
    : emitters_(std::move(emitters)),
      environment_(std::make_shared<const Environment>(std::move(environment))),
      maps_(std::move(maps)),
      centre_(centre),
      scene_radius_(radius) {
    disc_pdf_ = 1 / (kPi * radius * radius);
    std::vector<double> powers;
    for (size_t i = 0; i < emitters_.size(); ++i) {
        if (emitters_[i].kind == EmitterKind::kEnvironment) environment_index_ = int32_t(i);
        powers.push_back(power(emitters_[i]));
    }
    pick_ = AliasTable(powers);
    for (size_t i = 0; i < emitters_.size(); ++i) emitters_[i].pmf = pick_.pmf(i);
}

double EmitterSet::power(const Emitter& e) const {
    const double disc = kPiD * double(scene_radius_) * scene_radius_;
    switch (e.kind) {
        case EmitterKind::kTriangle:
        case EmitterKind::kSphere: {
            const Rgb mean = e.map == kNone ? e.radiance : e.radiance * maps_.surfaces[size_t(e.map)].mean();
            return kPiD * scalar_of(mean) / e.inv_area * (e.two_sided ? 2 : 1);
        }
        case EmitterKind::kPoint: return 4 * kPiD * scalar_of(e.radiance);
        case EmitterKind::kSpot: return kPiD * scalar_of(e.radiance) * (double(e.falloff_height) + double(e.total_height));
        case EmitterKind::kDistant: return scalar_of(e.radiance) * disc;
        case EmitterKind::kEnvironment: return environment_->integrated_radiance() * disc;
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: return scalar_of(e.radiance * direction_map(e).integral());
    }
    return 0;
}

Rgb EmitterSet::emitted(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w) const {
    switch (e.kind) {
        case EmitterKind::kTriangle:
        case EmitterKind::kSphere: return e.two_sided || dot(normal, w) > 0 ? radiance_at(e, position) : Rgb{};
        case EmitterKind::kPoint: return e.radiance;
        case EmitterKind::kSpot: return e.radiance * spot_falloff(e, w);
        case EmitterKind::kDistant: return e.radiance;
        case EmitterKind::kEnvironment: return environment_->radiance(-w);
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: return e.radiance * direction_map(e).intensity(w);
    }
    return {};
}

float EmitterSet::place_on_emitter(const Emitter& e, const Vec3& w) const {
    if (e.is_area()) return e.inv_area;
    return e.kind == EmitterKind::kEnvironment ? environment_->pdf_solid_angle(-w) : 1;
}

float EmitterSet::departure_by_power(const Emitter& e, const Vec3& normal, const Vec3& w) const {
    switch (e.kind) {
        case EmitterKind::kTriangle:
        case EmitterKind::kSphere: {
            const float c = dot(normal, w);
            if (e.two_sided) return std::fabs(c) * (0.5f * kInvPi);
            return c > 0 ? c * kInvPi : 0;
        }
        case EmitterKind::kPoint: return kInvFourPi;
        case EmitterKind::kSpot: return height_between(e.normal, w) <= e.total_height ? 1 / (kTwoPi * e.total_height) : 0;
        case EmitterKind::kDistant:
        case EmitterKind::kEnvironment: return disc_pdf_;
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: return direction_map(e).pdf_solid_angle(w);
    }
    return 0;
}

void EmitterSet::sample_place(double pick, Vec2 u, EmissionSample* out, float* rest) const {
    out->emitter = pick_.sample(pick, rest);
    sample_on_emitter(u, out, *rest);
}

void EmitterSet::sample_on_emitter(Vec2 u, EmissionSample* out, float rest) const {
    const Emitter& e = emitters_[out->emitter];
    switch (e.kind) {
        case EmitterKind::kTriangle: {
            const Vec2 b = sample_triangle(u);
            out->position = e.position + e.edge1 * b.x + e.edge2 * b.y;
            out->normal = e.normal;
            break;
        }
        case EmitterKind::kSphere: {
            const Vec3 n = sample_sphere(u);
            out->position = e.position + n * e.radius;
            out->normal = e.inward ? -n : n;
            break;
        }
        case EmitterKind::kPoint:
        case EmitterKind::kSpot:
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: out->position = e.position; break;
        case EmitterKind::kDistant: out->direction = out->normal = e.normal; break;
        case EmitterKind::kEnvironment: out->direction = out->normal = -environment_->sample(rest, u); break;
    }
}

void EmitterSet::start_before_scene(const Vec3& point, EmissionSample* out) const {
    const Vec3& w = out->direction;
    out->position = point - w * (dot(point - centre_, w) + scene_radius_);
}

void EmitterSet::sample_departure(float rest, Vec2 u, EmissionSample* out) const {
    const Emitter& e = emitters_[out->emitter];
    switch (e.kind) {
        case EmitterKind::kTriangle:
        case EmitterKind::kSphere: {
            Vec3 local = sample_cosine_hemisphere_concentric(u);
            if (e.two_sided && rest < 0.5f) local.z = -local.z;
            out->direction = Frame(out->normal).to_world(local);
            break;
        }
        case EmitterKind::kPoint: out->direction = out->normal = sample_sphere(u); break;
        case EmitterKind::kSpot: {
            const float height = u.x * e.total_height;
            const float z = 1 - height, r = safe_sqrt(height * (2 - height));
            const math::SinCos sc = math::sincos_turns(u.y);
            out->direction = out->normal = Frame(e.normal).to_world({r * float(sc.cos), r * float(sc.sin), z});
            break;
        }
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: out->direction = out->normal = direction_map(e).sample(rest, u); break;
        case EmitterKind::kDistant:
        case EmitterKind::kEnvironment: {
            const Vec2 d = sample_disk(u);
            const Frame f(out->direction);
            out->position = centre_ + (f.s * d.x + f.t * d.y - f.n) * scene_radius_;
            break;
        }
    }
}

bool EmitterSet::sample_emission(double pick, Vec2 u_position, Vec2 u_direction, EmissionSample* out) const {
    if (emitters_.empty()) return false;
    float rest = 0;
    Vec3 passed;
    out->alpha = {};
    if (!learned_) [[likely]] {
        sample_place(pick, u_position, out, &rest);
        sample_departure(rest, u_direction, out);
        passed = out->position;
    } else {
        sample_learned(pick, u_position, u_direction, out, &passed);
    }
    const Emitter& e = emitters_[out->emitter];
    const EmissionDensities densities = emission_densities(e, out->position, out->normal, out->direction, passed);
    out->pdf_position = densities.position, out->pdf_direction = densities.direction;
    if (!(out->pdf_position > 0)) return false;
    if (!(out->pdf_direction > 0)) return true;
    const float cosine = e.is_area() ? abs_dot(out->normal, out->direction) : 1;
    out->alpha = emitted(e, out->position, out->normal, out->direction) * (cosine / (out->pdf_position * out->pdf_direction));
    return true;
}

bool EmitterSet::sample_next_event(const Vec3& reference, double pick, Vec2 u, NextEventSample* out) const {
    if (emitters_.empty()) return false;
    float rest = 0;
    out->emitter = pick_.sample(pick, &rest);
    const Emitter& e = emitters_[out->emitter];
    if (e.is_infinite()) {
        out->wi = e.kind == EmitterKind::kDistant ? -e.normal : environment_->sample(rest, u);
        out->normal = -out->wi;
        out->position = reference + out->wi * (2 * scene_radius_);
        out->geometry = 1;
        out->pdf = place_by_power(e, -out->wi);
    } else {
        if (e.kind == EmitterKind::kTriangle) {
            const Vec2 b = sample_triangle(u);
            out->position = e.position + e.edge1 * b.x + e.edge2 * b.y;
            out->normal = e.normal;
        } else if (e.kind == EmitterKind::kSphere) {
            const Vec3 to_centre = e.position - reference;
            const float d2 = length_squared(to_centre);
            Vec3 n;
            if (samples_cone(e, d2)) {
                // A direction in the cone, t from its axis, then the near intersection, expressed as the normal of the sphere,
                // a from the axis: sin(a + t) = sin t d / r. Nothing cancels, however small the sphere looks [Pharr, Jakob and
                // Humphreys 2023, 6.2.4].
                const float one_minus_cos = cone_height(e.radius, d2) * u.x;
                const float sin2 = one_minus_cos * (2 - one_minus_cos);
                const float d = std::sqrt(d2), sin_max = e.radius / d;
                const float cos_a = sin2 / sin_max + (1 - one_minus_cos) * safe_sqrt(1 - sin2 / (sin_max * sin_max));
                const float sin_a = safe_sqrt(1 - cos_a * cos_a);
                const math::SinCos sc = math::sincos_turns(u.y);
                n = Frame(to_centre / d).to_world({sin_a * float(sc.cos), sin_a * float(sc.sin), -cos_a});
            } else {
                n = sample_sphere(u);
            }
            out->position = e.position + n * e.radius;
            out->normal = e.inward ? -n : n;
        } else {
            out->position = e.position;
        }
        if (!connect_point(reference, out->position, out->normal, out)) return false;
        out->pdf = pdf_next_event(e, reference, out->position, out->normal, out->wi);
        return out->pdf > 0;
    }
    out->radiance = emitted(e, out->position, out->normal, -out->wi);
    return out->pdf > 0 && !out->radiance.is_black();
}

bool EmitterSet::connect_point(const Vec3& reference, const Vec3& position, const Vec3& normal_or_travel,
                               NextEventSample* out) const {
    const Emitter& e = emitters_[out->emitter];
    out->normal = normal_or_travel;
    if (e.is_infinite()) {
        out->wi = -normal_or_travel;
        out->position = reference + out->wi * (2 * scene_radius_);
        out->geometry = 1;
    } else {
        out->position = position;
        const Vec3 to_light = position - reference;
        const float d2 = length_squared(to_light);
        if (!(d2 > 0)) return false;
        out->wi = to_light / std::sqrt(d2);
        if (!e.is_area()) out->normal = -out->wi;
        out->geometry = (e.is_area() ? abs_dot(out->normal, out->wi) : 1.0f) / d2;
    }
    out->radiance = emitted(e, out->position, out->normal, -out->wi);
    return out->geometry > 0 && !out->radiance.is_black();
}

float EmitterSet::pdf_next_event(const Emitter& e, const Vec3& reference, const Vec3& position, const Vec3& normal,
                                 const Vec3& wi) const {
    if (e.kind != EmitterKind::kSphere) return place_by_power(e, -wi);
    const float centre_d2 = length_squared(e.position - reference);
    if (!samples_cone(e, centre_d2)) return place_by_power(e, -wi);
    const float solid_angle = kTwoPi * cone_height(e.radius, centre_d2);
    const float d2 = length_squared(position - reference);
    // Only the near side is sampled.
    if (dot(normal, wi) >= 0) return 0;
    return e.pmf / solid_angle * abs_dot(normal, wi) / d2;
}

}  // namespace lightloom
