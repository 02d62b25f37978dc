#include "common/import/subdivide.h"

#include <cmath>
#include <unordered_map>

#include "common/core/math.h"

namespace lightloom::import {
namespace {

constexpr uint32_t kNoFace = 0xffffffffu, kUnused = kNoFace;

struct Point {
    double x = 0, y = 0, z = 0;

    Point& operator+=(const Point& o) {
        x += o.x, y += o.y, z += o.z;
        return *this;
    }
    friend Point operator*(const Point& p, double s) { return {p.x * s, p.y * s, p.z * s}; }
    friend Point operator+(Point a, const Point& b) { return a += b; }
    friend Point operator-(const Point& a, const Point& b) { return a + b * -1; }
};

Point cross_product(const Point& a, const Point& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

uint32_t next(uint32_t k) { return k == 2 ? 0 : k + 1; }
uint32_t previous(uint32_t k) { return k == 0 ? 2 : k - 1; }

struct Face {
    uint32_t vertex[3] = {};                           ///< Corners.
    uint32_t across[3] = {kNoFace, kNoFace, kNoFace};  ///< The face beyond the edge from corner k to the next; or kNoFace.

    uint32_t corner_of(uint32_t v) const { return vertex[0] == v ? 0 : vertex[1] == v ? 1 : 2; }
};

/// The mesh after some steps of subdivision.
struct Level {
    std::vector<Point> positions;
    std::vector<uint32_t> first_face;  ///< Per vertex: a face that has it as a corner. Its other faces are reached across edges.
    std::vector<char> is_boundary;     ///< Per vertex.
    std::vector<Face> faces;

    /// The neighbours of a vertex, clockwise around it; for one on the boundary, counter-clockwise from one end of the
    /// boundary to the other.
    void ring(uint32_t v, std::vector<uint32_t>* out) const {
        out->clear();
        uint32_t f = first_face[v];
        if (!is_boundary[v]) {
            do {
                const Face& face = faces[f];
                const uint32_t k = face.corner_of(v);
                out->push_back(face.vertex[next(k)]);
                f = face.across[k];
            } while (f != first_face[v]);
            return;
        }
        for (uint32_t beyond = faces[f].across[faces[f].corner_of(v)]; beyond != kNoFace;
             beyond = faces[f].across[faces[f].corner_of(v)])
            f = beyond;
        out->push_back(faces[f].vertex[next(faces[f].corner_of(v))]);
        while (f != kNoFace) {
            const uint32_t before = previous(faces[f].corner_of(v));
            out->push_back(faces[f].vertex[before]);
            f = faces[f].across[before];
        }
    }
};

/// (1 - n w) p + w times the sum over its n neighbours; for a vertex on the boundary, over its two neighbours along it.
Point blend(const Level& level, uint32_t v, const std::vector<uint32_t>& ring, double w) {
    if (level.is_boundary[v])
        return level.positions[v] * (1 - 2 * w) + (level.positions[ring.front()] + level.positions[ring.back()]) * w;
    Point sum;
    for (const uint32_t i : ring) sum += level.positions[i];
    return level.positions[v] * (1 - double(ring.size()) * w) + sum * w;
}

/// Weight of a neighbour of an old vertex, from the number of its neighbours [Warren 1995].
double step_weight(size_t valence) { return valence == 3 ? 3.0 / 16 : 3 / (8 * double(valence)); }

/// The same for the limit of all further steps.
double limit_weight(size_t valence) { return 1 / (double(valence) + 3 / (8 * step_weight(valence))); }

Result<Level> control_mesh(const std::vector<Vec3>& points, const std::vector<uint32_t>& indices) {
    Level level;
    std::vector<uint32_t> number(points.size(), kUnused);
    for (const uint32_t i : indices) number[i] = 0;
    for (uint32_t i = 0; i < points.size(); ++i) {
        if (number[i] == kUnused) continue;
        number[i] = uint32_t(level.positions.size());
        level.positions.push_back({double(points[i].x), double(points[i].y), double(points[i].z)});
    }
    level.first_face.resize(level.positions.size());
    level.faces.resize(indices.size() / 3);
    std::unordered_map<uint64_t, uint32_t> edges;  // from << 32 | to: face * 3 + corner
    const auto key = [](uint32_t from, uint32_t to) { return (uint64_t(from) << 32) | to; };
    for (uint32_t f = 0; f < level.faces.size(); ++f) {
        Face& face = level.faces[f];
        for (uint32_t k = 0; k < 3; ++k) {
            face.vertex[k] = number[indices[size_t(f) * 3 + k]];
            // Where surfaces touch in a point, pbrt-v4 assigns it to the last face that has it.
            level.first_face[face.vertex[k]] = f;
        }
        for (uint32_t k = 0; k < 3; ++k) {
            const auto refused = [&](const char* what) { return invalid_argument("face " + std::to_string(f) + what); };
            if (face.vertex[k] == face.vertex[next(k)]) return refused(" has a point at two of its corners");
            if (!edges.emplace(key(face.vertex[k], face.vertex[next(k)]), f * 3 + k).second)
                return refused(
                    " runs along one of its edges in the same direction as another face; a subdivision "
                    "surface needs at most two faces at an edge, both with their corners in the same order");
        }
    }
    for (uint32_t f = 0; f < level.faces.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            Face& face = level.faces[f];
            const auto it = edges.find(key(face.vertex[next(k)], face.vertex[k]));
            if (it != edges.end()) face.across[k] = it->second / 3;
        }
    level.is_boundary.resize(level.positions.size());
    for (uint32_t v = 0; v < level.positions.size(); ++v) {
        // Every directed edge has one face, so that this walk returns to its start or ends.
        uint32_t f = level.first_face[v];
        do {
            f = level.faces[f].across[level.faces[f].corner_of(v)];
        } while (f != kNoFace && f != level.first_face[v]);
        level.is_boundary[v] = f == kNoFace;
    }
    return level;
}

/// Child k of a face lies at its corner k, which is also the child's corner k; child 3 lies in the middle, and its
/// corner k is the new vertex of edge k.
Level subdivided(const Level& old) {
    Level level;
    std::vector<uint32_t> ring;
    const uint32_t old_count = uint32_t(old.positions.size());
    level.faces.resize(old.faces.size() * 4);
    level.is_boundary = old.is_boundary;
    for (uint32_t v = 0; v < old_count; ++v) {
        old.ring(v, &ring);
        level.positions.push_back(blend(old, v, ring, old.is_boundary[v] ? 1.0 / 8 : step_weight(ring.size())));
        level.first_face.push_back(old.first_face[v] * 4 + old.faces[old.first_face[v]].corner_of(v));
    }
    for (uint32_t f = 0; f < old.faces.size(); ++f) {
        const Face& face = old.faces[f];
        Face* child = &level.faces[size_t(f) * 4];
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t from = face.vertex[k], to = face.vertex[next(k)], beyond = face.across[k];
            uint32_t middle = uint32_t(level.positions.size());
            const uint32_t back = beyond == kNoFace ? 0 : old.faces[beyond].corner_of(to);
            if (beyond != kNoFace && beyond < f) {
                middle = level.faces[size_t(beyond) * 4 + 3].vertex[back];
            } else {
                Point p = old.positions[from] + old.positions[to];
                if (beyond == kNoFace)
                    p = p * 0.5;
                else
                    p = p * (3.0 / 8) +
                        (old.positions[face.vertex[previous(k)]] + old.positions[old.faces[beyond].vertex[previous(back)]]) *
                            (1.0 / 8);
                level.positions.push_back(p);
                level.first_face.push_back(f * 4 + 3);
                level.is_boundary.push_back(beyond == kNoFace);
            }
            child[k].vertex[k] = from;
            child[k].vertex[next(k)] = child[next(k)].vertex[k] = child[3].vertex[k] = middle;
            child[k].across[next(k)] = f * 4 + 3;
            child[3].across[k] = f * 4 + next(k);
            // Beyond an edge, the children at its two ends are neighbours of those here.
            if (beyond == kNoFace) continue;
            child[k].across[k] = beyond * 4 + old.faces[beyond].corner_of(from);
            child[next(k)].across[k] = beyond * 4 + back;
        }
    }
    return level;
}

/// Normal of the limit surface, of any length; computed from the limit positions of the neighbours.
Point limit_normal(const Level& level, uint32_t v, const std::vector<uint32_t>& ring) {
    const auto at = [&](size_t i) { return level.positions[ring[i]]; };
    const size_t n = ring.size();
    Point along, across;
    if (!level.is_boundary[v]) {
        for (size_t i = 0; i < n; ++i) {
            const math::SinCos turn = math::sincos_turns(double(i) / double(n));
            along += at(i) * turn.cos;
            across += at(i) * turn.sin;
        }
        return cross_product(along, across);
    }
    const Point& p = level.positions[v];
    along = at(n - 1) - at(0);
    if (n == 2) {
        across = at(0) + at(1) - p * 2;
    } else if (n == 3) {
        across = at(1) - p;
    } else if (n == 4) {  // This is the regular case.
        across = (at(1) + at(2)) * 2 - at(0) - at(3) - p * 2;
    } else {
        const math::SinCos unit = math::sincos_turns(0.5 / double(n - 1));
        across = (at(0) + at(n - 1)) * -unit.sin;
        for (size_t i = 1; i + 1 < n; ++i)
            across += at(i) * ((2 - 2 * unit.cos) * math::sincos_turns(0.5 * double(i) / double(n - 1)).sin);
    }
    return cross_product(along, across);
}

/// Normalises; false if the vector has no direction.
bool to_unit(const Point& n, Vec3* out) {
    const double length = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    if (!(length > 0) || !std::isfinite(length)) return false;
    *out = {float(n.x / length), float(n.y / length), float(n.z / length)};
    return true;
}

}  // namespace

Result<TriangleMesh> loop_subdivide(const std::vector<Vec3>& points, const std::vector<uint32_t>& indices, int levels,
                                    uint64_t max_triangles) {
    if (levels < 0) return invalid_argument("levels must not be negative");
    uint64_t triangles = indices.size() / 3;
    for (int i = 0; i < levels && triangles > 0 && triangles <= max_triangles; ++i) triangles *= 4;
    if (triangles > max_triangles)
        return invalid_argument("with " + std::to_string(levels) + " levels it becomes more than " + std::to_string(max_triangles) +
                                " triangles; use fewer levels");
    Result<Level> control = control_mesh(points, indices);
    if (!control.ok()) return control.status();
    Level level = std::move(control).value();
    for (int i = 0; i < levels && triangles > 0; ++i) level = subdivided(level);

    std::vector<uint32_t> ring;
    std::vector<Point> limits;
    for (uint32_t v = 0; v < level.positions.size(); ++v) {
        level.ring(v, &ring);
        limits.push_back(blend(level, v, ring, level.is_boundary[v] ? 1.0 / 5 : limit_weight(ring.size())));
    }
    level.positions = std::move(limits);

    TriangleMesh mesh;
    std::vector<Point> clockwise(level.positions.size());  // sums of the faces' own normals, on the outer side
    for (const Face& face : level.faces) {
        const Point& a = level.positions[face.vertex[0]];
        const Point n = cross_product(level.positions[face.vertex[2]] - a, level.positions[face.vertex[1]] - a);
        for (const uint32_t v : face.vertex) {
            clockwise[v] += n;
            mesh.indices.push_back(v);
        }
    }
    for (uint32_t v = 0; v < level.positions.size(); ++v) {
        const Point& p = level.positions[v];
        mesh.positions.push_back({float(p.x), float(p.y), float(p.z)});
        level.ring(v, &ring);
        Vec3 n{0, 0, 1};  // It stays only where all faces are without area, which nothing can hit.
        if (!to_unit(limit_normal(level, v, ring), &n)) to_unit(clockwise[v], &n);
        mesh.normals.push_back(n);
    }
    return mesh;
}

}  // namespace lightloom::import
