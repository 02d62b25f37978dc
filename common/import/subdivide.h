#pragma once
// Turns subdivision surfaces into triangle meshes.

#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom::import {

/// Loop's subdivision surface of a control mesh [Loop 1987], with the rules that pbrt-v4 uses: each of `levels` steps
/// makes four triangles of one; the vertices are then moved onto the limit surface and get its unit normals. Three
/// `indices`, in range, make a face; points that no face uses are left out. Edges of one face are a boundary, a curve
/// that depends on the boundary's points alone. Seen from the tip of a normal, the corners of a face go clockwise, as
/// in pbrt-v4.
///
/// kInvalidArgument: negative levels, more than `max_triangles`, a face with a corner twice, or two faces that run along an edge in
/// the same direction (the surface has no consistent side, or more than two faces meet at the edge).
Result<TriangleMesh> loop_subdivide(const std::vector<Vec3>& points, const std::vector<uint32_t>& indices, int levels,
                                    uint64_t max_triangles);

}  // namespace lightloom::import
