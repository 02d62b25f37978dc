#pragma once
// 4x4 affine and projective transformations in double, because scene files compose many of them.

#include <array>
#include <cmath>
#include <optional>

#include "common/core/vec.h"

namespace lightloom {

/// Row-major 4x4 matrix acting on column vectors: p' = M p.
struct Mat4 {
    std::array<std::array<double, 4>, 4> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};

    friend bool operator==(const Mat4&, const Mat4&) = default;

    Vec3 point(const Vec3& p) const {
        double r[4];
        for (int i = 0; i < 4; ++i) r[i] = m[i][0] * p.x + m[i][1] * p.y + m[i][2] * p.z + m[i][3];
        const double inv = r[3] == 1 ? 1 : 1 / r[3];
        return {float(r[0] * inv), float(r[1] * inv), float(r[2] * inv)};
    }
    Vec3 vector(const Vec3& v) const {
        return {float(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z), float(m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z),
                float(m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z)};
    }
    /// The product with the transpose of the upper 3x3: pass the INVERSE of the point transformation to map normals.
    Vec3 normal_by_inverse(const Vec3& n) const {
        return {float(m[0][0] * n.x + m[1][0] * n.y + m[2][0] * n.z), float(m[0][1] * n.x + m[1][1] * n.y + m[2][1] * n.z),
                float(m[0][2] * n.x + m[1][2] * n.y + m[2][2] * n.z)};
    }
    double determinant3() const {
        return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    }
    bool swaps_handedness() const { return determinant3() < 0; }
};

Mat4 operator*(const Mat4& a, const Mat4& b);
/// Returns nothing when the matrix is singular or not finite.
std::optional<Mat4> inverse(const Mat4& m);
Mat4 translation(double x, double y, double z);
Mat4 scaling(double x, double y, double z);
/// Rotation by `degrees` about an axis that need not be of unit length.
Mat4 rotation(double degrees, double x, double y, double z);
/// World-to-camera matrix looking along +z with `up` towards +y (pbrt's convention). Returns nothing when the
/// directions are degenerate.
std::optional<Mat4> look_at(const Vec3& eye, const Vec3& target, const Vec3& up);

}  // namespace lightloom
