#include "common/scene/camera.h"

#include <cmath>

#include "common/core/math.h"
#include "common/scene/sampling.h"

namespace lightloom {

Result<Camera> Camera::create(const CameraDescription& source, int width, int height) {
    if (width <= 0 || height <= 0) return invalid_argument("the image resolution must be positive");
    if (!(source.fov_degrees > 0 && source.fov_degrees < 180))
        return invalid_argument("camera fov must lie between 0 and 180 degrees, not " + std::to_string(source.fov_degrees));
    if (source.lens_radius < 0 || !(source.focal_distance > 0))
        return invalid_argument("camera lensradius must not be negative and focaldistance must be positive");
    if (source.kind != CameraKind::kPerspective && source.lens_radius > 0)
        return invalid_argument("only a perspective camera has a lens; its lensradius must be 0");
    Camera c;
    c.kind_ = source.kind;
    const auto& m = source.camera_to_world.m;
    const auto column = [&](int j) { return Vec3{float(m[0][j]), float(m[1][j]), float(m[2][j])}; };
    const float sx = length(column(0)), sy = length(column(1)), sz = length(column(2));
    c.right_ = column(0) / sx;
    c.up_ = column(1) / sy;
    c.forward_ = column(2) / sz;
    c.position_ = column(3);
    if (!keeps_angles(source.camera_to_world))
        return invalid_argument("the camera transformation must not shear or scale axes differently; use fov or screenwindow");
    c.width_ = width;
    c.height_ = height;
    const float aspect = source.frame_aspect_ratio > 0 ? source.frame_aspect_ratio : float(width) / float(height);
    float window[4] = {-1, 1, -1, 1};
    if (source.has_screen_window)
        for (int i = 0; i < 4; ++i) window[i] = source.screen_window[i];
    else if (aspect > 1)
        window[0] = -aspect, window[1] = aspect;
    else
        window[2] = -1 / aspect, window[3] = 1 / aspect;
    if (!(window[1] > window[0] && window[3] > window[2])) return invalid_argument("camera screenwindow is empty");
    const float scale = source.kind == CameraKind::kPerspective ? float(math::tan(double(source.fov_degrees) * (kPiD / 360))) : sz;
    c.x0_ = window[0] * scale;
    c.y1_ = window[3] * scale;
    c.pixel_w_ = (window[1] - window[0]) * scale / float(width);
    c.pixel_h_ = (window[3] - window[2]) * scale / float(height);
    c.inv_pixel_area_ = 1 / (c.pixel_w_ * c.pixel_h_);
    c.lens_radius_ = source.lens_radius * sz;
    c.focal_distance_ = source.focal_distance * sz;
    return c;
}

Vec3 Camera::sample_lens(Vec2 lens) const {
    if (lens_radius_ == 0) return position_;
    const Vec2 d = sample_disk(lens);
    return position_ + right_ * (d.x * lens_radius_) + up_ * (d.y * lens_radius_);
}

namespace {

/// The longitude-latitude and octahedral mappings have their pole at +z, cameras at +y.
Vec3 swap_yz(const Vec3& d) { return {d.x, d.z, d.y}; }

}  // namespace

Camera::CameraRay Camera::sample_other_ray(Vec2 film) const {
    const auto to_world = [&](const Vec3& d) { return normalize(right_ * d.x + up_ * d.y + forward_ * d.z); };
    const float pixels = float(width_) * float(height_);
    CameraRay ray;
    ray.origin = position_;
    if (kind_ == CameraKind::kOrthographic) {
        ray.origin = position_ + right_ * (x0_ + film.x * pixel_w_) + up_ * (y1_ - film.y * pixel_h_);
        ray.direction = forward_;
        ray.pdf = inv_pixel_area_;
    } else if (kind_ == CameraKind::kEqualArea) {
        ray.direction = to_world(swap_yz(equal_area_square_to_sphere({film.x / float(width_), film.y / float(height_)})));
        ray.pdf = pixels / (4 * kPi);
    } else {
        const math::SinCos theta = math::sincos(kPiD * double(film.y) / height_);
        const math::SinCos phi = math::sincos(2 * kPiD * double(film.x) / width_);
        ray.direction = to_world({float(theta.sin * phi.cos), float(theta.cos), float(theta.sin * phi.sin)});
        ray.pdf = pixels / (2 * kPi * kPi * float(theta.sin));  // d(omega) = sin(theta) d(theta) d(phi)
    }
    return ray;
}

bool Camera::project_other(const Vec3& start, const Vec3& direction, Vec2* film, float* pdf) const {
    const float width = float(width_), height = float(height_);
    const Vec3 d{dot(direction, right_), dot(direction, up_), dot(direction, forward_)};
    if (kind_ == CameraKind::kOrthographic) {
        if (!(d.z > 0.999f)) return false;
        const Vec3 offset = start - position_;
        film->x = (dot(offset, right_) - x0_) / pixel_w_;
        film->y = (y1_ - dot(offset, up_)) / pixel_h_;
        *pdf = inv_pixel_area_;
        return film->x >= 0 && film->x < width && film->y >= 0 && film->y < height;
    }
    // Every direction belongs to a pixel: what rounds to the far border belongs to the last one.
    constexpr float kBelowOne = 0x1.fffffep-1f;
    Vec2 uv;
    if (kind_ == CameraKind::kEqualArea) {
        uv = equal_area_sphere_to_square(swap_yz(d));
        *pdf = width * height / (4 * kPi);
    } else {
        const float sine = std::sqrt(d.x * d.x + d.z * d.z);
        if (!(sine > 0)) return false;  // a pole has no longitude, and no density
        double phi = math::atan2(double(d.z), double(d.x));
        if (phi < 0) phi += 2 * kPiD;
        uv = {float(phi / (2 * kPiD)), float(math::atan2(double(sine), double(d.y)) / kPiD)};
        *pdf = width * height / (2 * kPi * kPi * sine);
    }
    film->x = clamp(uv.x, 0.0f, kBelowOne) * width;
    film->y = clamp(uv.y, 0.0f, kBelowOne) * height;
    return true;
}

bool Camera::see(const Vec3& point, Vec3* lens, Sight* sight) const {
    if (kind_ == CameraKind::kOrthographic) {
        const float depth = dot(point - position_, forward_);
        if (!(depth > 0)) return false;
        *lens = point - forward_ * depth;
        sight->direction = forward_;
        sight->distance2 = 1;
    } else {
        const Vec3 d = point - *lens;
        sight->distance2 = length_squared(d);
        if (!(sight->distance2 > 0)) return false;
        sight->direction = d / std::sqrt(sight->distance2);
    }
    return project(*lens, sight->direction, &sight->film, &sight->pdf);
}

Camera::CameraRay Camera::sample_ray(Vec2 film, Vec2 lens) const {
    if (kind_ != CameraKind::kPerspective) return sample_other_ray(film);
    const Vec3 p{x0_ + film.x * pixel_w_, y1_ - film.y * pixel_h_, 1};  // on the film plane, camera space
    CameraRay ray;
    ray.origin = position_;
    Vec3 d = p;
    if (has_lens()) {
        const Vec2 l = sample_disk(lens);
        ray.origin = position_ + right_ * (l.x * lens_radius_) + up_ * (l.y * lens_radius_);
        d = p * focal_distance_ - Vec3{l.x * lens_radius_, l.y * lens_radius_, 0};
    }
    d = normalize(d);
    ray.direction = normalize(right_ * d.x + up_ * d.y + forward_ * d.z);
    // d(omega) = pixel area * cos^3, also through a thin lens: the plane of focus is the film plane scaled by f.
    ray.pdf = inv_pixel_area_ / (d.z * d.z * d.z);
    return ray;
}

bool Camera::project(const Vec3& lens_point, const Vec3& direction, Vec2* film, float* pdf) const {
    if (kind_ != CameraKind::kPerspective) return project_other(lens_point, direction, film, pdf);
    const Vec3 d{dot(direction, right_), dot(direction, up_), dot(direction, forward_)};
    if (!(d.z > 1e-6f)) return false;
    Vec3 p{d.x / d.z, d.y / d.z, 1};
    if (lens_radius_ > 0) {
        const Vec3 l = lens_point - position_;
        p.x += dot(l, right_) / focal_distance_;
        p.y += dot(l, up_) / focal_distance_;
    }
    film->x = (p.x - x0_) / pixel_w_;
    film->y = (y1_ - p.y) / pixel_h_;
    if (!(film->x >= 0 && film->x < float(width_) && film->y >= 0 && film->y < float(height_))) return false;
    *pdf = inv_pixel_area_ / (d.z * d.z * d.z);
    return true;
}

}  // namespace lightloom
