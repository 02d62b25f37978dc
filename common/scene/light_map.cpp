#include "common/scene/light_map.h"

#include <algorithm>
#include <cmath>

#include "common/core/math.h"
#include "common/scene/accel.h"
#include "common/scene/emitter.h"

namespace lightloom {
namespace {

/// Most subdivisions of a triangle's edges, and number of rows and columns on a sphere.
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
    // The points are the centroids of n^2 congruent triangles in two orientations.
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
    // Barycentric weights come from least squares in double, because they cancel in thin triangles.
    const auto product = [](const Vec3& p, const Vec3& q) { return double(p.x) * q.x + double(p.y) * q.y + double(p.z) * q.z; };
    const Vec3 d = position - e.position;
    const double a = product(e.edge1, e.edge1), b = product(e.edge1, e.edge2), c = product(e.edge2, e.edge2);
    const double p = product(d, e.edge1), q = product(d, e.edge2), determinant = a * c - b * b;
    if (!(determinant > 0)) return lookup(uv_[0]);
    const float b1 = float((c * p - b * q) / determinant), b2 = float((a * q - b * p) / determinant), b0 = 1 - b1 - b2;
    return lookup({b0 * uv_[0].x + b1 * uv_[1].x + b2 * uv_[2].x, b0 * uv_[0].y + b1 * uv_[1].y + b2 * uv_[2].y});
}

DirectionMap::DirectionMap(const Image& image, const Mat4& light_to_world) : image_(&image), to_world_(light_to_world) {
    for (int i = 0; i < 3; ++i) to_world_.m[i][3] = 0;
    to_light_ = *inverse(to_world_);  // Scene::build() has refused singular ones
}

DirectionMap DirectionMap::projection(const Image& image, const Mat4& light_to_world, float half_width, float half_height) {
    DirectionMap map(image, light_to_world);
    map.planar_ = true;
    map.half_width_ = half_width, map.half_height_ = half_height;
    map.set_weights(projected_solid_angles(image.width, image.height, double(half_width), double(half_height)));
    return map;
}

DirectionMap DirectionMap::goniometric(const Image& image, const Mat4& light_to_world) {
    // The map's pole is the light's y.
    Mat4 swap;
    swap.m = {{{1, 0, 0, 0}, {0, 0, 1, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}}};
    DirectionMap map(image, light_to_world * swap);
    const size_t n = size_t(image.width) * size_t(image.height);
    map.set_weights(std::vector<double>(n, 4 * kPiD / double(n)));
    return map;
}

void DirectionMap::set_weights(const std::vector<double>& solid_angles) {
    std::vector<double> weights(solid_angles.size());
    double sum[3] = {}, covered = 0;
    for (size_t i = 0; i < weights.size(); ++i) {
        const Rgb value = texel(i);
        for (int c = 0; c < 3; ++c) sum[c] += double(value[c]) * solid_angles[i];
        covered += solid_angles[i];
        weights[i] = double(scalar_of(value)) * solid_angles[i];
    }
    integral_ = {float(sum[0]), float(sum[1]), float(sum[2])};
    covered_ = float(covered);
    texels_ = AliasTable(weights);
}

Rgb DirectionMap::texel(size_t i) const {
    const Rgb value = image_->texel(int(i % size_t(image_->width)), int(i / size_t(image_->width)));
    return planar_ ? value : Rgb(value.average());
}

bool DirectionMap::find(const Vec3& w, size_t* texel, float* density) const {
    const Vec3 d = normalize(to_light_.vector(w));
    Vec2 uv;
    if (planar_) {
        if (!(d.z > 0)) return false;
        const float x = d.x / d.z, y = d.y / d.z;
        if (!(std::fabs(x) <= half_width_ && std::fabs(y) <= half_height_)) return false;
        uv = {0.5f + 0.5f * x / half_width_, 0.5f - 0.5f * y / half_height_};
        // d(omega) = dA cos^3 on the plane at distance 1.
        *density = float(texels_.size()) / (4 * half_width_ * half_height_ * d.z * d.z * d.z);
    } else {
        uv = equal_area_sphere_to_square(d);
        *density = float(texels_.size()) / (4 * kPi);
    }
    const auto cell = [](float c, int n) { return size_t(std::clamp(int(c * float(n)), 0, n - 1)); };
    *texel = cell(uv.y, image_->height) * size_t(image_->width) + cell(uv.x, image_->width);
    return true;
}

Rgb DirectionMap::intensity(const Vec3& w) const {
    size_t i = 0;
    float density = 0;
    return find(w, &i, &density) ? texel(i) : Rgb{};
}

float DirectionMap::pdf_solid_angle(const Vec3& w) const {
    size_t i = 0;
    float density = 0;
    return find(w, &i, &density) ? texels_.pmf(i) * density : 0;
}

Vec3 DirectionMap::sample(float pick, Vec2 u) const {
    float inside = 0;
    const uint32_t i = texels_.sample(double(u.x) + double(pick) * 0x1p-24, &inside);
    const uint32_t w = uint32_t(image_->width);
    const Vec2 uv{(float(i % w) + inside) / float(w), (float(i / w) + u.y) / float(image_->height)};
    const Vec3 d = planar_ ? Vec3{(2 * uv.x - 1) * half_width_, (1 - 2 * uv.y) * half_height_, 1} : equal_area_square_to_sphere(uv);
    return normalize(to_world_.vector(d));
}

Rgb SurfaceMap::lookup(Vec2 uv) const {
    const int w = image_->width, h = image_->height;
    const auto unit = [](float c) { return c > 0 ? std::min(c, 1.0f) : 0.0f; };  // NaN becomes 0
    const float x = unit(uv.x) * float(w) - 0.5f, y = (1 - unit(uv.y)) * float(h) - 0.5f;
    const float fx = std::floor(x), fy = std::floor(y), dx = x - fx, dy = y - fy;
    const int x0 = std::clamp(int(fx), 0, w - 1), x1 = std::clamp(int(fx) + 1, 0, w - 1);
    const int y0 = std::clamp(int(fy), 0, h - 1), y1 = std::clamp(int(fy) + 1, 0, h - 1);
    return (image_->texel(x0, y0) * (1 - dx) + image_->texel(x1, y0) * dx) * (1 - dy) +
           (image_->texel(x0, y1) * (1 - dx) + image_->texel(x1, y1) * dx) * dy;
}

}  // namespace lightloom
