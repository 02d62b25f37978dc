#pragma once
// Object-space triangle meshes of the shapes that the renderer cannot trace directly.

#include <optional>

#include "common/scene/description.h"

namespace lightloom::import {

inline constexpr int kTurnSegments = 128;  ///< For a full turn; a part of a turn has its share of them, rounded up.
inline constexpr int kSphereRings = 64;    ///< From pole to pole.
inline constexpr int kEllipsoidTriangles = 2 * (2 * kSphereRings) * (kSphereRings - 1);
inline constexpr int kPatchSteps = 16;

/// The uniform scale of a matrix that maps spheres to spheres (rotation, reflection, uniform scale, translation, to a
/// relative 1e-5); nothing for others.
std::optional<double> similarity_scale(const Mat4& m);

/// A sector of `phimax` degrees, in (0, 360], of the disk or ring about the z axis at `height`. Its rims are polygons scaled so
/// that the area is that of the true shape; they stay within 3 10^-4 of the radius.
TriangleMesh tessellate_disk(float radius, float inner_radius, float height, float phimax);

/// The part of a sphere about the origin between the planes zmin < zmax, in [-radius, radius], and within `phimax`
/// degrees, with pbrt's (u, v) and exact normals at the vertices. A whole sphere has its vertices on the sphere; a part
/// is scaled so that its area is the true one, and stays within 3 10^-4 of the radius.
TriangleMesh tessellate_sphere(float radius, float zmin, float zmax, float phimax);

/// A cylinder about the z axis, open at zmin < zmax, with pbrt's (u, v) and exact normals at the vertices. Its polygon
/// is scaled so that the area is that of the true cylinder; it stays within 3 10^-4 of the radius. Its corners have the
/// same directions as those of a disk of the same `phimax`, so that the disk closes it.
TriangleMesh tessellate_cylinder(float radius, float zmin, float zmax, float phimax);

/// Turns faces of four corners (p00, p10, p01, p11) into triangles. A parallelogram becomes two, which is exact; any
/// other patch becomes a grid, and `*curved` is set. `*faces` receives the patch number of every triangle.
TriangleMesh tessellate_patches(const TriangleMesh& patches, bool* curved, std::vector<uint32_t>* faces);

}  // namespace lightloom::import
