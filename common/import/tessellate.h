#pragma once
// Object-space triangle meshes of the shapes that the renderer does not trace as such.

#include <optional>

#include "common/scene/description.h"

namespace lightloom::import {

inline constexpr int kDiskSegments = 128;
inline constexpr int kSphereRings = 64;
inline constexpr int kEllipsoidTriangles = 2 * (2 * kSphereRings) * (kSphereRings - 1);
inline constexpr int kPatchSteps = 16;

/// The uniform scale of a matrix that maps spheres to spheres (rotation, reflection, uniform scale, translation, to a
/// relative 1e-5); nothing for others.
std::optional<double> similarity_scale(const Mat4& m);

/// A disk or ring about the z axis at `height`. Its rims are polygons scaled so that the area is that of the true disk.
TriangleMesh tessellate_disk(float radius, float inner_radius, float height);

/// A sphere about the origin with pbrt's (u, v) and exact normals at the vertices.
TriangleMesh tessellate_sphere(float radius);

/// Four corners per face (p00, p10, p01, p11) to triangles. A parallelogram becomes two, which is exact; any other
/// patch a grid, and then `*curved` is set. `*faces` gets the number of the patch of every triangle.
TriangleMesh tessellate_patches(const TriangleMesh& patches, bool* curved, std::vector<uint32_t>* faces);

}  // namespace lightloom::import
