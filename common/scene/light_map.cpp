#include "common/scene/light_map.h"

#include <algorithm>
#include <cmath>

#include "common/core/math.h"
#include "common/scene/accel.h"
#include "common/scene/emitter.h"

namespace lightloom {
namespace {

/// Subdivisions of a triangle's edges, and rows and columns on a sphere.
constexpr int kFinest = 32;

}  // namespace

SurfaceMap::SurfaceMap(const Image& image, const Rgb& image_mean, const Vec2 uv[3]) : image_(&image) {
    std::copy(uv, uv + 3, uv_);
    float texels = 0;  // the longest edge, in texels
    for (int i = 0; i < 3; ++i) {
        const Vec2 &a = uv[i], &b = uv[(i + 1) % 3];
        texels = std::max({texels, std::fabs(a.x - b.x) * float(image.width), std::fabs(a.y - b.y) * float(image.height)});
    }
    const int n = texels < kFinest / 2 ? std::max(1, int(std::ceil(2 * texels))) : kFinest;
    // Centroids of n^2 congruent triangles, in two orientations.
    const auto centroid = [&](double b1, double b2) {
        const float u = float(b1 / n), v = float(b2 / n), w = 1 - u - v;
        return lookup({w * uv[0].x + u * uv[1].x + v * uv[2].x, w * uv[0].y + u * uv[1].y + v * uv[2].y});
    };
    for (int i = 0; i < n; ++i)
        for (int j = 0; i + j < n; ++j) {
            mean_ += centroid(i + 1 / 3.0, j + 1 / 3.0);
            if (i + j + 1 < n) mean_ += centroid(i + 2 / 3.0, j + 2 / 3.0);
        }
    mean_ *= 1 / float(n * n);
    raise_mean(image_mean);
}

SurfaceMap::SurfaceMap(const Image& image, const Rgb& image_mean, const Frame& orientation)
    : image_(&image),
      orientation_(orientation) {
    for (int i = 0; i < kFinest; ++i) {
        const float height = (float(i) + 0.5f) * (2.0f / kFinest) - 1;  // equal steps are equal areas
        const float v = float(1 - math::acos(double(height)) / kPiD);
        for (int j = 0; j < kFinest; ++j) mean_ += lookup({(float(j) + 0.5f) / kFinest, v});
    }
    mean_ *= 1 / float(kFinest * kFinest);
    raise_mean(image_mean);
}

void SurfaceMap::raise_mean(const Rgb& image_mean) {
    const Rgb least = image_mean * 0.01f;
    mean_ = {std::max(mean_.r, least.r), std::max(mean_.g, least.g), std::max(mean_.b, least.b)};
}

Rgb SurfaceMap::at(const Emitter& e, const Vec3& position) const {
    if (e.kind == EmitterKind::kSphere) return lookup(sphere_uv(orientation_, (position - e.position) / e.radius));
    // Barycentric weights by least squares, in double: they cancel in thin triangles.
    const auto product = [](const Vec3& p, const Vec3& q) { return double(p.x) * q.x + double(p.y) * q.y + double(p.z) * q.z; };
    const Vec3 d = position - e.position;
    const double a = product(e.edge1, e.edge1), b = product(e.edge1, e.edge2), c = product(e.edge2, e.edge2);
    const double p = product(d, e.edge1), q = product(d, e.edge2), determinant = a * c - b * b;
    if (!(determinant > 0)) return lookup(uv_[0]);
    const float b1 = float((c * p - b * q) / determinant), b2 = float((a * q - b * p) / determinant), b0 = 1 - b1 - b2;
    return lookup({b0 * uv_[0].x + b1 * uv_[1].x + b2 * uv_[2].x, b0 * uv_[0].y + b1 * uv_[1].y + b2 * uv_[2].y});
}

Rgb SurfaceMap::lookup(Vec2 uv) const {
    const int w = image_->width, h = image_->height;
    const auto unit = [](float c) { return c > 0 ? std::min(c, 1.0f) : 0.0f; };  // also of what is no number
    const float x = unit(uv.x) * float(w) - 0.5f, y = (1 - unit(uv.y)) * float(h) - 0.5f;
    const float fx = std::floor(x), fy = std::floor(y), dx = x - fx, dy = y - fy;
    const int x0 = std::clamp(int(fx), 0, w - 1), x1 = std::clamp(int(fx) + 1, 0, w - 1);
    const int y0 = std::clamp(int(fy), 0, h - 1), y1 = std::clamp(int(fy) + 1, 0, h - 1);
    return (image_->texel(x0, y0) * (1 - dx) + image_->texel(x1, y0) * dx) * (1 - dy) +
           (image_->texel(x0, y1) * (1 - dx) + image_->texel(x1, y1) * dx) * dy;
}

}  // namespace lightloom
