#include "common/core/transform.h"

#include <utility>

#include "common/core/math.h"

namespace lightloom {

Mat4 operator*(const Mat4& a, const Mat4& b) {
    Mat4 r;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
            r.m[i][j] = 0;
            for (int k = 0; k < 4; ++k) r.m[i][j] += a.m[i][k] * b.m[k][j];
        }
    return r;
}

std::optional<Mat4> inverse(const Mat4& source) {
    // Gauss-Jordan with partial pivoting; whether a pivot counts as zero depends on the largest entry of the matrix, so
    // that a scene in micrometres is as invertible as one in kilometres.
    auto a = source.m;
    Mat4 inv;
    double size = 0;
    for (const auto& row : a)
        for (const double v : row) {
            if (!std::isfinite(v)) return std::nullopt;
            size = std::fmax(size, std::fabs(v));
        }
    for (int col = 0; col < 4; ++col) {
        int pivot = col;
        for (int row = col + 1; row < 4; ++row)
            if (std::fabs(a[row][col]) > std::fabs(a[pivot][col])) pivot = row;
        if (std::fabs(a[pivot][col]) <= 1e-18 * size) return std::nullopt;
        std::swap(a[pivot], a[col]);
        std::swap(inv.m[pivot], inv.m[col]);
        const double scale = 1 / a[col][col];
        for (int j = 0; j < 4; ++j) a[col][j] *= scale, inv.m[col][j] *= scale;
        for (int row = 0; row < 4; ++row) {
            if (row == col) continue;
            const double f = a[row][col];
            for (int j = 0; j < 4; ++j) a[row][j] -= f * a[col][j], inv.m[row][j] -= f * inv.m[col][j];
        }
    }
    for (const auto& row : inv.m)
        for (const double v : row)
            if (!std::isfinite(v)) return std::nullopt;
    return inv;
}

Mat4 translation(double x, double y, double z) {
    Mat4 r;
    r.m[0][3] = x, r.m[1][3] = y, r.m[2][3] = z;
    return r;
}

Mat4 scaling(double x, double y, double z) {
    Mat4 r;
    r.m[0][0] = x, r.m[1][1] = y, r.m[2][2] = z;
    return r;
}

Mat4 rotation(double degrees, double x, double y, double z) {
    const double len = std::sqrt(x * x + y * y + z * z);
    x /= len, y /= len, z /= len;
    const double rad = degrees * (kPiD / 180);
    const double c = math::cos(rad), s = math::sin(rad);
    Mat4 r;
    r.m[0] = {x * x + (1 - x * x) * c, x * y * (1 - c) - z * s, x * z * (1 - c) + y * s, 0};
    r.m[1] = {x * y * (1 - c) + z * s, y * y + (1 - y * y) * c, y * z * (1 - c) - x * s, 0};
    r.m[2] = {x * z * (1 - c) - y * s, y * z * (1 - c) + x * s, z * z + (1 - z * z) * c, 0};
    return r;
}

std::optional<Mat4> look_at(const Vec3& eye, const Vec3& target, const Vec3& up) {
    struct D3 {
        double x, y, z;
    };
    const auto unit = [](D3 v) {
        const double len = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
        return D3{v.x / len, v.y / len, v.z / len};
    };
    const auto crossed = [](D3 a, D3 b) { return D3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; };
    const D3 dir = unit({double(target.x) - eye.x, double(target.y) - eye.y, double(target.z) - eye.z});
    const D3 right = unit(crossed(unit({up.x, up.y, up.z}), dir));
    const D3 new_up = crossed(dir, right);
    Mat4 camera_to_world;
    camera_to_world.m[0] = {right.x, new_up.x, dir.x, eye.x};
    camera_to_world.m[1] = {right.y, new_up.y, dir.y, eye.y};
    camera_to_world.m[2] = {right.z, new_up.z, dir.z, eye.z};
    return inverse(camera_to_world);
}

}  // namespace lightloom
