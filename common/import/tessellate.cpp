#include "common/import/tessellate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/core/math.h"

namespace lightloom::import {

std::optional<double> similarity_scale(const Mat4& m) {
    if (m.m[3][0] != 0 || m.m[3][1] != 0 || m.m[3][2] != 0) return std::nullopt;
    double dots[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) dots[i][j] = m.m[0][i] * m.m[0][j] + m.m[1][i] * m.m[1][j] + m.m[2][i] * m.m[2][j];
    const double mean = (dots[0][0] + dots[1][1] + dots[2][2]) / 3;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (!(std::fabs(dots[i][j] - (i == j ? mean : 0)) <= 1e-5 * mean)) return std::nullopt;
    return std::sqrt(mean) / std::fabs(m.m[3][3]);
}

namespace {

/// Directions in the xy plane, spread evenly over a part of a turn.
struct Fan {
    uint32_t segments;
    double turns;

    explicit Fan(float phimax) : segments(uint32_t(std::ceil(kTurnSegments * double(phimax) / 360))), turns(double(phimax) / 360) {}
    double angle() const { return turns * 2 * kPiD / segments; }
    math::SinCos direction(uint32_t i) const {
        return math::sincos_turns(turns == 1 ? double(i % segments) / segments : turns * double(i) / segments);
    }
};

double area_of(const TriangleMesh& mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
        const Vec3& a = mesh.positions[mesh.indices[i]];
        sum += 0.5 * double(length(cross(mesh.positions[mesh.indices[i + 1]] - a, mesh.positions[mesh.indices[i + 2]] - a)));
    }
    return sum;
}

}  // namespace

TriangleMesh tessellate_disk(float radius, float inner_radius, float height, float phimax) {
    // The triangle of two corners at distance r' and the centre has the area r'^2 sin(a) / 2; make it r^2 a / 2.
    const Fan fan(phimax);
    const double grow = std::sqrt(fan.angle() / math::sin(fan.angle()));
    TriangleMesh mesh;
    for (uint32_t i = 0; i <= fan.segments; ++i) {
        const math::SinCos d = fan.direction(i);
        const float u = float(i) / float(fan.segments);
        for (const float r : {inner_radius, radius}) {
            mesh.positions.push_back({float(d.cos * r * grow), float(d.sin * r * grow), height});
            mesh.uvs.push_back({u, (radius - r) / (radius - inner_radius)});
        }
    }
    for (uint32_t i = 0; i < fan.segments; ++i) {
        const uint32_t a = 2 * i;  // inner, outer, next inner, next outer
        if (inner_radius > 0) mesh.indices.insert(mesh.indices.end(), {a, a + 1, a + 2});
        mesh.indices.insert(mesh.indices.end(), {a + 1, a + 3, a + 2});
    }
    return mesh;
}

TriangleMesh tessellate_sphere(float radius, float zmin, float zmax, float phimax) {
    // Polar angles are counted from the south pole, in turns.
    const double lowest = 0.5 - math::acos(double(zmin) / radius) / (2 * kPiD);
    const double highest = 0.5 - math::acos(double(zmax) / radius) / (2 * kPiD);
    const bool south = zmin <= -radius, north = zmax >= radius;
    const Fan fan(phimax);
    const uint32_t rings = std::max(1u, uint32_t(std::ceil((highest - lowest) * 2 * kSphereRings)));
    TriangleMesh mesh;
    mesh.curved = true;
    for (uint32_t ring = 0; ring <= rings; ++ring) {
        const math::SinCos theta = math::sincos_turns(lowest + (highest - lowest) * double(ring) / rings);
        const double sine = (south && ring == 0) || (north && ring == rings) ? 0 : theta.sin;
        for (uint32_t sector = 0; sector <= fan.segments; ++sector) {
            const math::SinCos phi = fan.direction(sector);
            const Vec3 n{float(sine * phi.cos), float(sine * phi.sin), float(-theta.cos)};
            mesh.positions.push_back(n * radius);
            mesh.normals.push_back(n);
            mesh.uvs.push_back({float(sector) / float(fan.segments), float(ring) / float(rings)});
        }
    }
    for (uint32_t ring = 0; ring < rings; ++ring)
        for (uint32_t sector = 0; sector < fan.segments; ++sector) {
            const uint32_t a = ring * (fan.segments + 1) + sector, b = a + fan.segments + 1;
            if (!south || ring > 0) mesh.indices.insert(mesh.indices.end(), {a, a + 1, b + 1});
            if (!north || ring + 1 < rings) mesh.indices.insert(mesh.indices.end(), {a, b + 1, b});
        }
    if (south && north && fan.turns == 1) return mesh;
    const double area = fan.turns * 2 * kPiD * radius * (double(zmax) - zmin);
    const float grow = float(std::sqrt(area / area_of(mesh)));
    for (Vec3& p : mesh.positions) p *= grow;
    return mesh;
}

TriangleMesh tessellate_cylinder(float radius, float zmin, float zmax, float phimax) {
    // A chord between corners at distance r' is 2 r' sin(a / 2) long; make it r a.
    const Fan fan(phimax);
    const double grow = 0.5 * fan.angle() / math::sin(0.5 * fan.angle());
    TriangleMesh mesh;
    mesh.curved = true;
    for (uint32_t i = 0; i <= fan.segments; ++i) {
        const math::SinCos d = fan.direction(i);
        for (const bool top : {false, true}) {
            mesh.positions.push_back({float(d.cos * radius * grow), float(d.sin * radius * grow), top ? zmax : zmin});
            mesh.normals.push_back({float(d.cos), float(d.sin), 0});
            mesh.uvs.push_back({float(i) / float(fan.segments), top ? 1.0f : 0.0f});
        }
    }
    for (uint32_t i = 0; i < fan.segments; ++i) {
        const uint32_t a = 2 * i;  // bottom, top, next bottom, next top
        mesh.indices.insert(mesh.indices.end(), {a, a + 2, a + 3, a, a + 3, a + 1});
    }
    return mesh;
}

namespace {

bool is_parallelogram(const Vec3* p) {
    const Vec3 defect = p[0] - p[1] - p[2] + p[3];
    return length_squared(defect) <= 1e-10f * (length_squared(p[1] - p[0]) + length_squared(p[2] - p[0]));
}

template <typename T>
T bilinear(const T* c, float u, float v) {
    return c[0] * ((1 - u) * (1 - v)) + c[1] * (u * (1 - v)) + c[2] * ((1 - u) * v) + c[3] * (u * v);
}

}  // namespace

TriangleMesh tessellate_patches(const TriangleMesh& patches, bool* curved, std::vector<uint32_t>* faces) {
    constexpr Vec2 kCorners[4] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
    TriangleMesh mesh;
    mesh.curved = true;
    for (size_t face = 0; face + 3 < patches.indices.size(); face += 4) {
        Vec3 p[4], n[4];
        Vec2 uv[4];
        for (size_t k = 0; k < 4; ++k) {
            const uint32_t index = patches.indices[face + k];
            p[k] = patches.positions[index];
            if (!patches.normals.empty()) n[k] = patches.normals[index];
            uv[k] = patches.uvs.empty() ? kCorners[k] : patches.uvs[index];
        }
        const bool even_uv =
            patches.uvs.empty() || (uv[0].x - uv[1].x - uv[2].x + uv[3].x == 0 && uv[0].y - uv[1].y - uv[2].y + uv[3].y == 0);
        const bool flat = is_parallelogram(p) && even_uv && patches.normals.empty();
        *curved = *curved || !flat;
        const uint32_t steps = flat ? 1 : kPatchSteps;
        const uint32_t base = uint32_t(mesh.positions.size());
        for (uint32_t j = 0; j <= steps; ++j)
            for (uint32_t i = 0; i <= steps; ++i) {
                const float u = float(i) / float(steps), v = float(j) / float(steps);
                mesh.positions.push_back(bilinear(p, u, v));
                if (!patches.normals.empty()) mesh.normals.push_back(bilinear(n, u, v));
                const Vec3 texture = bilinear(std::array<Vec3, 4>{Vec3{uv[0].x, uv[0].y, 0}, Vec3{uv[1].x, uv[1].y, 0},
                                                                  Vec3{uv[2].x, uv[2].y, 0}, Vec3{uv[3].x, uv[3].y, 0}}
                                                  .data(),
                                              u, v);
                mesh.uvs.push_back({texture.x, texture.y});
            }
        for (uint32_t j = 0; j < steps; ++j)
            for (uint32_t i = 0; i < steps; ++i) {
                const uint32_t a = base + j * (steps + 1) + i, b = a + steps + 1;
                mesh.indices.insert(mesh.indices.end(), {a, a + 1, b + 1, a, b + 1, b});
            }
        faces->resize(mesh.indices.size() / 3, uint32_t(face / 4));
    }
    return mesh;
}

}  // namespace lightloom::import
