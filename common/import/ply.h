#pragma once
// Reads PLY meshes: ASCII, binary little-endian and big-endian.

#include <string_view>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom::import {

struct PlyMesh {
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;  ///< Empty or one per position, as in the file; zero where one is not finite.
    size_t finite_normals = 0;
    std::vector<Vec2> uvs;  ///< Empty or one per position.
    std::vector<uint32_t> indices;
    std::vector<uint32_t> faces;                  ///< The face of every triangle; empty if all faces are triangles.
    bool has_polygons = false;                    ///< Faces of more than four vertices.
    size_t skipped_faces = 0;                     ///< Faces of fewer than three vertices, which are left out.
    std::vector<std::string> ignored_properties;  ///< Vertex and face properties that nothing here uses.
};

/// Decodes a PLY file. Polygons become fans of triangles around their first vertex, and triangle strips become
/// triangles. Elements may come in any order; elements that are not used here, and what follows the last one, are
/// skipped. Reserves no more memory than the data can fill, whatever the header claims; every index is checked and
/// every position and (u, v) is finite. The error message does not name the file.
Result<PlyMesh> read_ply(std::string_view bytes);

}  // namespace lightloom::import
