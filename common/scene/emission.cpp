// How light sub-paths leave the lights: by power, mixed with what was learned. With
//     P, p   places and departures by power,      b     EmissionData::power_share
//     L, l   places and departures as learned,    g, d  power_places, power_directions
// the joint density is
//     b P p + (1 - b) Q q,    Q = g P + (1 - g) L,    q = d p + (1 - d) l,
// of which EmissionDensities::position is the marginal b P + (1 - b) Q, and direction the rest.
#include "common/core/math.h"
#include "common/scene/emitter.h"
#include "common/scene/emitter_square.h"

namespace lightloom {
namespace {

/// Splits off the event of probability p; `u` becomes a new uniform number.
bool happens(double p, double* u) {
    if (*u < p) {
        *u /= p;
        return true;
    }
    *u = (*u - p) / (1 - p);
    if (*u >= 1) *u = 0x1.fffffffffffffp-1;
    return false;
}

}  // namespace

float EmitterSet::learned_place(const Emitter& e, const Vec3& position, const Vec3& w) const {
    const uint32_t index = uint32_t(&e - emitters_.data());
    const float probability = learned_->probability(index);
    const uint32_t root = learned_->place(index);
    if (root == kUniformSquare || !has_square(e)) return probability * place_on_emitter(e, w);
    const float inv_area = e.kind == EmitterKind::kEnvironment ? kInvFourPi : e.inv_area;
    return probability * inv_area * learned_->density(root, emitter_square(e, position, w));
}

float EmitterSet::learned_departure(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w,
                                    const Vec3& x1) const {
    // The image of a light at a point has more detail than a learned density.
    if (e.has_direction_map()) return departure_by_power(e, normal, w);
    return e.is_infinite() ? learned_->pdf_crossing(w, x1) : learned_->pdf_direction(position, w);
}

float EmitterSet::pdf_position(const Emitter& e, const Vec3& position, const Vec3& w) const {
    const float by_power = place_by_power(e, w);
    if (!learned_) [[likely]]
        return by_power;
    const EmissionData& data = learned_->data();
    const float learned = data.power_places * by_power + (1 - data.power_places) * learned_place(e, position, w);
    return data.power_share * by_power + (1 - data.power_share) * learned;
}

EmissionDensities EmitterSet::emission_densities(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w,
                                                 const Vec3& x1) const {
    const float place_power = place_by_power(e, w), by_power = departure_by_power(e, normal, w);
    if (!learned_) [[likely]]
        return {place_power, by_power};
    const EmissionData& data = learned_->data();
    const float place = data.power_places * place_power + (1 - data.power_places) * learned_place(e, position, w);
    const float learned =
        data.power_directions * by_power + (1 - data.power_directions) * learned_departure(e, position, normal, w, x1);
    // The marginal may exceed the range of single precision's reciprocal; ratios of both shares do not.
    const float of_power = data.power_share * place_power, of_learned = (1 - data.power_share) * place;
    const float marginal = of_power + of_learned;
    return {marginal, marginal > 0 ? (of_power / marginal) * by_power + (of_learned / marginal) * learned : 0};
}

void EmitterSet::sample_learned(double pick, Vec2 u_position, Vec2 u_direction, EmissionSample* out, Vec3* passed) const {
    const EmissionData& data = learned_->data();
    // All choices between shares are made before the rest of the numbers is used, because places use them differently.
    const bool by_power = happens(double(data.power_share), &pick);
    const bool place_by_power = by_power || happens(double(data.power_places), &pick);
    const bool departs_by_power = by_power || happens(double(data.power_directions), &pick);
    float rest = 0;
    if (place_by_power) {
        sample_place(pick, u_position, out, &rest);
    } else {
        out->emitter = learned_->pick(pick, &rest);
        const Emitter& e = emitters_[out->emitter];
        const uint32_t root = learned_->place(out->emitter);
        if (root == kUniformSquare || !has_square(e)) {
            sample_on_emitter(u_position, out, rest);
        } else if (e.kind == EmitterKind::kEnvironment) {
            out->direction = out->normal = -equal_area_square_to_sphere(learned_->sample(root, u_position));
        } else {
            out->position = point_in_square(e, learned_->sample(root, u_position), &out->normal);
        }
    }
    const Emitter& e = emitters_[out->emitter];
    if (departs_by_power || e.has_direction_map()) {
        sample_departure(rest, u_direction, out);
    } else if (e.is_infinite()) {
        // The origin of the ray, at the border of the scene, is rounded too coarsely to tell where it crosses a small cell.
        *passed = learned_->sample_crossing(out->direction, u_direction);
        return start_before_scene(*passed, out);
    } else {
        out->direction = learned_->sample_direction(out->position, u_direction);
        if (!e.is_area()) out->normal = out->direction;
    }
    *passed = out->position;
}

}  // namespace lightloom
