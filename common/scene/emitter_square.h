#pragma once
// The unit square as a map of the places x_0 on an emitter: equal areas of the square are equal areas of the emitter, or
// equal solid angles of the environment.

#include "common/scene/emitter.h"

namespace lightloom {

/// Whether x_0 of `e` lies on a square at all; if not, it is one of countably many.
inline bool has_square(const Emitter& e) { return !e.is_discrete(); }
/// Coordinates in [0, 1]^2 of a point on an emitter; of the environment those of the direction of travel `w`. The origin
/// for an emitter without a square.
Vec2 emitter_square(const Emitter& e, const Vec3& position, const Vec3& w);
/// The reverse for area lights: the point, and the geometric normal there on the emitting side.
Vec3 point_in_square(const Emitter& e, Vec2 p, Vec3* normal);

}  // namespace lightloom
