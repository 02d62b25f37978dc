// Shapes become triangle meshes and spheres in world space (the space of the object inside ObjectBegin).
//
// Orientation: a mesh keeps its corners in file order; `flip_normal` is ReverseOrientation xor "the transformation
// swaps handedness", which makes the geometric normal the image of the object-space one. pbrt-v4 turns the object-space
// normal of a mirrored sphere, disk or cylinder where a ray hits it: a mirrored glass sphere is a hole in glass. Where
// it samples light on such a shape it does not turn the normal; here shapes that emit keep their side, whether hit or
// sampled.

#include <cmath>

#include "common/core/math.h"
#include "common/import/context.h"
#include "common/import/ply.h"
#include "common/import/subdivide.h"
#include "common/import/tessellate.h"

namespace lightloom::import {
namespace {

Mat4 checked_inverse(const ParameterList& parameters, const Mat4& m) {
    const std::optional<Mat4> inverted = inverse(m);
    if (!inverted) fail(parameters.where(), parameters.what() + ": its transformation is singular");
    return *inverted;
}

/// Area-weighted vertex normals of the geometry itself, for vertices whose stored normal is zero.
std::vector<Vec3> geometric_normals(const TriangleMesh& mesh) {
    std::vector<Vec3> sums(mesh.positions.size());
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
        const uint32_t* v = &mesh.indices[i];
        const Vec3 n = cross(mesh.positions[v[1]] - mesh.positions[v[0]], mesh.positions[v[2]] - mesh.positions[v[0]]);
        for (int k = 0; k < 3; ++k) sums[v[k]] += n;
    }
    return sums;
}

/// Normalises in double: a float's square may underflow for a tiny normal.
bool normalise(Vec3* n) {
    const double x = n->x, y = n->y, z = n->z, len = std::sqrt(x * x + y * y + z * z);
    if (!(len > 0)) return false;
    *n = {float(x / len), float(y / len), float(z / len)};
    return true;
}

/// Moves an object-space mesh to world space.
TriangleMesh place(Context* context, const ParameterList& parameters, TriangleMesh mesh, const ShapeState& state) {
    const Mat4 world_to_object = checked_inverse(parameters, state.object_to_world);
    const bool identity = state.object_to_world == Mat4();
    for (Vec3& p : mesh.positions) {
        if (!identity) p = state.object_to_world.point(p);
        if (!is_finite(p)) fail(parameters.where(), parameters.what() + ": a vertex is not finite after its transformation");
        if (!within_bounds(p)) fail(parameters.where(), parameters.what() + ": a vertex lies beyond 1e15; scale the scene down");
    }
    mesh.attributes.mirrored = state.object_to_world.swaps_handedness();
    mesh.attributes.flip_normal = state.reverse_orientation != mesh.attributes.mirrored;
    std::vector<Vec3> substitutes;
    for (size_t i = 0; i < mesh.normals.size(); ++i) {
        Vec3 n = world_to_object.normal_by_inverse(mesh.normals[i]);
        if (state.reverse_orientation) n = -n;
        if (!normalise(&n)) {
            if (substitutes.empty()) {
                context->diagnostics.warn(
                    parameters.where(),
                    parameters.what() + ": a normal has length zero or is not finite; the geometry's own is used there");
                substitutes = geometric_normals(mesh);
            }
            n = mesh.attributes.flip_normal ? -substitutes[i] : substitutes[i];
            if (!normalise(&n)) n = {0, 0, 1};  // All triangles of this vertex are degenerate: nothing can hit it.
        }
        mesh.normals[i] = n;
    }
    return mesh;
}

std::vector<Vec3> points(const ParameterList& parameters, std::string_view type, std::string_view name) {
    std::vector<Vec3> out;
    if (const std::vector<double>* v = parameters.numbers(type, name, 3)) {
        out.reserve(v->size() / 3);
        for (size_t i = 0; i < v->size(); i += 3) out.push_back({float((*v)[i]), float((*v)[i + 1]), float((*v)[i + 2])});
    }
    return out;
}

/// Reads P and indices; `corners` vertices make one face.
TriangleMesh read_points_and_indices(const ParameterList& parameters, size_t corners) {
    const std::string& what = parameters.what();
    TriangleMesh mesh;
    mesh.positions = points(parameters, "point3", "P");
    if (mesh.positions.empty()) fail(parameters.where(), what + " has no \"point3 P\"");
    if (const std::vector<double>* indices = parameters.numbers("integer", "indices", corners)) {
        mesh.indices.reserve(indices->size());
        for (const double index : *indices) {
            if (index < 0 || index >= double(mesh.positions.size()))
                fail(parameters.where(), what + ": the index " + std::to_string(int64_t(index)) + " is out of range; there are " +
                                             std::to_string(mesh.positions.size()) + " points");
            mesh.indices.push_back(uint32_t(index));
        }
    } else if (mesh.positions.size() == corners) {
        for (size_t i = 0; i < corners; ++i) mesh.indices.push_back(uint32_t(i));
    } else {
        fail(parameters.where(), what + " has no \"integer indices\"");
    }
    return mesh;
}

/// For trianglemesh and bilinearmesh: the same with N and uv.
TriangleMesh read_mesh(const ParameterList& parameters, size_t corners) {
    const std::string& what = parameters.what();
    TriangleMesh mesh = read_points_and_indices(parameters, corners);
    mesh.normals = points(parameters, "normal", "N");
    if (const std::vector<double>* uv = parameters.numbers("point2", "uv", 2))
        for (size_t i = 0; i < uv->size(); i += 2) mesh.uvs.push_back({float((*uv)[i]), float((*uv)[i + 1])});
    if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
        fail(parameters.where(), what + ": N has " + std::to_string(mesh.normals.size()) + " normals for " +
                                     std::to_string(mesh.positions.size()) + " points");
    if (!mesh.uvs.empty() && mesh.uvs.size() != mesh.positions.size())
        fail(parameters.where(), what + ": uv has " + std::to_string(mesh.uvs.size()) + " pairs for " +
                                     std::to_string(mesh.positions.size()) + " points");
    return mesh;
}

TriangleMesh triangle_mesh(Context* context, const ParameterList& parameters, const ShapeState& state) {
    TriangleMesh mesh = read_mesh(parameters, 3);
    parameters.ignore(&context->diagnostics, "S",
                      "tangents only turn anisotropic highlights and normal maps, which follow the (u, v) directions here");
    parameters.ignore(&context->diagnostics, "faceIndices", "no texture here is looked up by face");
    return place(context, parameters, std::move(mesh), state);
}

TriangleMesh ply_mesh(Context* context, const ParameterList& parameters, const ShapeState& state, std::vector<uint32_t>* faces) {
    parameters.refuse("displacement", "displacement changes the geometry; bake it into the mesh");
    parameters.ignore(&context->diagnostics, "edgelength", "it only matters together with displacement");
    const std::string reference = parameters.one_string("filename", "");
    if (reference.empty()) fail(parameters.where(), parameters.what() + " has no \"string filename\"");
    std::string bytes = context->read_file(parameters.where(), reference);
    if (bytes.size() > 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b') {
        Result<std::string> inflated = inflate_gzip(bytes, context->options.max_file_bytes);
        if (!inflated.ok()) fail(parameters.where(), quoted(reference) + ": " + inflated.status().message());
        bytes = std::move(inflated).value();
    }
    Result<PlyMesh> ply = read_ply(bytes);
    if (!ply.ok()) fail(parameters.where(), quoted(reference) + ": " + ply.status().message());
    for (const std::string& name : ply->ignored_properties)
        context->diagnostics.warn(parameters.where(), "the PLY property " + quoted(name) + " is ignored: nothing here uses it");
    if (ply->has_polygons)
        context->diagnostics.warn(parameters.where(), quoted(reference) +
                                                          ": faces of more than four vertices become fans of "
                                                          "triangles; pbrt leaves them out");
    if (ply->skipped_faces > 0)
        context->diagnostics.warn(parameters.where(), quoted(reference) + ": " + std::to_string(ply->skipped_faces) +
                                                          " faces of fewer than three vertices are left out, as in pbrt");
    TriangleMesh mesh;
    mesh.positions = std::move(ply->positions);
    mesh.normals = std::move(ply->normals);
    if (ply->finite_normals == 0 && !mesh.normals.empty()) {
        context->diagnostics.warn(parameters.where(), quoted(reference) + ": its normals are not finite and are left out");
        mesh.normals.clear();
    }
    mesh.uvs = std::move(ply->uvs);
    mesh.indices = std::move(ply->indices);
    *faces = std::move(ply->faces);
    return place(context, parameters, std::move(mesh), state);
}

/// The angle that a part of a quadric covers, in degrees; as in pbrt, more than a full turn counts as one.
float read_phimax(const ParameterList& parameters) {
    const float phimax = parameters.one_float("phimax", 360);
    if (!(phimax > 0)) fail(parameters.where(), parameters.what() + ": phimax must be positive, in degrees");
    return std::fmin(phimax, 360.0f);
}

struct Interval {
    float zmin, zmax;
};

/// Reads zmin and zmax, clipped to `limits`.
Interval read_interval(Context* context, const ParameterList& parameters, const Interval& fallback, const Interval& limits) {
    Interval z{parameters.one_float("zmin", fallback.zmin), parameters.one_float("zmax", fallback.zmax)};
    if (z.zmin > z.zmax) {
        context->diagnostics.warn(parameters.where(), parameters.what() + ": zmin is above zmax; as in pbrt, they are exchanged");
        std::swap(z.zmin, z.zmax);
    }
    z = {std::fmax(z.zmin, limits.zmin), std::fmin(z.zmax, limits.zmax)};
    if (!(z.zmin < z.zmax))
        fail(parameters.where(), parameters.what() + ": zmin and zmax leave nothing of it; set zmin below zmax");
    return z;
}

/// Marks all triangles as parts of one shape.
void join(const TriangleMesh& mesh, std::vector<uint32_t>* faces) { faces->assign(mesh.indices.size() / 3, 0); }

/// The state for a sphere, disk or cylinder; see above.
ShapeState quadric(ShapeState state) {
    if (!state.emits && state.object_to_world.swaps_handedness()) state.reverse_orientation = !state.reverse_orientation;
    return state;
}

std::variant<TriangleMesh, Sphere> sphere(Context* context, const ParameterList& parameters, const ShapeState& state,
                                          std::vector<uint32_t>* faces) {
    const float radius = parameters.one_float("radius", 1);
    if (!(radius > 0)) fail(parameters.where(), parameters.what() + ": the radius must be positive");
    const Interval whole{-radius, radius}, z = read_interval(context, parameters, whole, whole);
    const float phimax = read_phimax(parameters);
    if (z.zmin > -radius || z.zmax < radius || phimax < 360) {
        context->diagnostics.warn(parameters.where(), parameters.what() + ": a part of a sphere becomes triangles with smooth " +
                                                          "normals and exactly its area, true to 0.03 % of the radius");
        TriangleMesh mesh = tessellate_sphere(radius, z.zmin, z.zmax, phimax);
        join(mesh, faces);
        return place(context, parameters, std::move(mesh), quadric(state));
    }
    checked_inverse(parameters, state.object_to_world);
    const std::optional<double> scale = similarity_scale(state.object_to_world);
    if (!scale) {
        context->diagnostics.warn(parameters.where(), parameters.what() +
                                                          ": its transformation is not a similarity, so it becomes " +
                                                          std::to_string(kEllipsoidTriangles) + " triangles with smooth normals");
        TriangleMesh mesh = tessellate_sphere(radius, -radius, radius, 360);
        join(mesh, faces);
        return place(context, parameters, std::move(mesh), quadric(state));
    }
    Sphere s;
    s.centre = state.object_to_world.point({0, 0, 0});
    s.radius = float(double(radius) * *scale);
    if (!is_finite(s.centre) || !std::isfinite(s.radius) || !(s.radius > 0))
        fail(parameters.where(), parameters.what() + ": its transformed centre or radius is not a usable number");
    if (!within_bounds(s.centre) || s.radius > kMaxCoordinate)
        fail(parameters.where(), parameters.what() + ": its centre or radius lies beyond 1e15; scale the scene down");
    Vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (Vec3& axis : axes) {
        axis = state.object_to_world.vector(axis);
        normalise(&axis);
    }
    s.orientation = Frame(axes[0], axes[1], axes[2]);
    s.attributes.flip_normal = quadric(state).reverse_orientation;
    s.attributes.mirrored = state.object_to_world.swaps_handedness();
    return s;
}

TriangleMesh disk(Context* context, const ParameterList& parameters, const ShapeState& state, std::vector<uint32_t>* faces) {
    const float radius = parameters.one_float("radius", 1), inner = parameters.one_float("innerradius", 0);
    const float height = parameters.one_float("height", 0);
    if (!(radius > 0) || !(inner >= 0) || !(inner < radius))
        fail(parameters.where(), parameters.what() + ": radius must be positive and larger than innerradius");
    const float phimax = read_phimax(parameters);
    context->diagnostics.warn(parameters.where(),
                              parameters.what() + ": disks become a ring of " + std::to_string(kTurnSegments) +
                                  " segments (a turn) of exactly the disk's area; the rim is true to 0.03 % of the radius");
    TriangleMesh mesh = tessellate_disk(radius, inner, height, phimax);
    join(mesh, faces);
    return place(context, parameters, std::move(mesh), quadric(state));
}

TriangleMesh cylinder(Context* context, const ParameterList& parameters, const ShapeState& state, std::vector<uint32_t>* faces) {
    const float radius = parameters.one_float("radius", 1);
    if (!(radius > 0)) fail(parameters.where(), parameters.what() + ": the radius must be positive");
    const Interval z = read_interval(context, parameters, {-1, 1}, {-HUGE_VALF, HUGE_VALF});
    const float phimax = read_phimax(parameters);
    context->diagnostics.warn(parameters.where(),
                              parameters.what() + ": cylinders become a ring of " + std::to_string(kTurnSegments) +
                                  " segments (a turn) of exactly the cylinder's area with smooth normals, true " +
                                  "to 0.03 % of the radius");
    TriangleMesh mesh = tessellate_cylinder(radius, z.zmin, z.zmax, phimax);
    join(mesh, faces);
    return place(context, parameters, std::move(mesh), quadric(state));
}

/// As in pbrt, the outside of the limit surface is the side from which the corners of a face are seen clockwise.
TriangleMesh subdivision_surface(Context* context, const ParameterList& parameters, const ShapeState& state) {
    const int levels = parameters.one_int("levels", 3);
    parameters.accept("string", "scheme");  // There is only one scheme; pbrt ignores the value, too.
    const TriangleMesh control = read_points_and_indices(parameters, 3);
    Result<TriangleMesh> mesh =
        loop_subdivide(control.positions, control.indices, levels, context->options.max_subdivided_triangles);
    if (!mesh.ok()) fail(parameters.where(), parameters.what() + ": " + mesh.status().message());
    return place(context, parameters, std::move(mesh).value(), state);
}

TriangleMesh bilinear_mesh(Context* context, const ParameterList& parameters, const ShapeState& state,
                           std::vector<uint32_t>* faces) {
    parameters.ignore(&context->diagnostics, "emissionfilename",
                      "it only guides pbrt's choice of points on the light, whose image is the light's \"filename\"");
    parameters.ignore(&context->diagnostics, "faceIndices", "no texture here is looked up by face");
    bool curved = false;
    TriangleMesh mesh = tessellate_patches(read_mesh(parameters, 4), &curved, faces);
    if (curved)
        context->diagnostics.warn(parameters.where(), parameters.what() + ": a patch that is no parallelogram becomes a grid of " +
                                                          std::to_string(kPatchSteps) + " x " + std::to_string(kPatchSteps) +
                                                          " quadrilaterals");
    return place(context, parameters, std::move(mesh), state);
}

}  // namespace

std::variant<TriangleMesh, Sphere> make_shape(Context* context, const std::string& kind, const ParameterList& parameters,
                                              const ShapeState& state, std::vector<uint32_t>* faces) {
    faces->clear();
    if (kind == "trianglemesh") return triangle_mesh(context, parameters, state);
    if (kind == "plymesh") return ply_mesh(context, parameters, state, faces);
    if (kind == "sphere") return sphere(context, parameters, state, faces);
    if (kind == "disk") return disk(context, parameters, state, faces);
    if (kind == "cylinder") return cylinder(context, parameters, state, faces);
    if (kind == "loopsubdiv") return subdivision_surface(context, parameters, state);
    if (kind == "bilinearmesh") return bilinear_mesh(context, parameters, state, faces);
    fail(parameters.where(),
         parameters.what() + " is not supported; use trianglemesh, plymesh, loopsubdiv, sphere, disk, cylinder or bilinearmesh");
}

}  // namespace lightloom::import
