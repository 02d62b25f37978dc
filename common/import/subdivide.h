#pragma once
// Subdivision surfaces.

#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom::import {

/// Triangles that a subdivision surface may become.
inline constexpr uint64_t kMaxSubdividedTriangles = uint64_t(1) << 23;

/// Loop's subdivision surface of a control mesh [Loop 1987], with the rules that pbrt-v4 uses: every one of `levels` steps makes
/// four triangles of one; the vertices are then moved onto the limit surface, and carry its unit normals. Three `indices` make a
/// face; points that no face uses are left out. Edges of one face are a boundary, which is a B-spline curve of the boundary's
/// points alone. Seen from the tip of a normal, the corners of a face go clockwise, as in pbrt-v4. kInvalidArgument: negative
/// levels, too many triangles, a face with a corner twice, or two faces that run along an edge in the same direction (which is to
/// say: a surface without a consistent side, or more than two faces at an edge).
Result<TriangleMesh> loop_subdivide(const std::vector<Vec3>& points, const std::vector<uint32_t>& indices, int levels);

}  // namespace lightloom::import
