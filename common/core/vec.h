#pragma once
// Small fixed-size vectors. Vec3 is used for points, directions and normals; Rgb is linear RGB radiance, reflectance or
// throughput (Rec.709 primaries). No operation here calls libm except sqrt, which is a correctly rounded instruction.

#include <cmath>
#include <cstdint>

namespace lightloom {

struct Vec2 {
    float x = 0, y = 0;
};

struct Vec3 {
    float x = 0, y = 0, z = 0;

    constexpr float operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
    constexpr Vec3 operator-() const { return {-x, -y, -z}; }
    constexpr Vec3& operator+=(const Vec3& b) {
        x += b.x, y += b.y, z += b.z;
        return *this;
    }
    constexpr Vec3& operator*=(float s) {
        x *= s, y *= s, z *= s;
        return *this;
    }
    friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

constexpr Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
constexpr Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
constexpr Vec3 operator*(const Vec3& a, float s) { return {a.x * s, a.y * s, a.z * s}; }
constexpr Vec3 operator*(float s, const Vec3& a) { return a * s; }
constexpr Vec3 operator/(const Vec3& a, float s) { return a * (1.0f / s); }

constexpr float dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
constexpr float abs_dot(const Vec3& a, const Vec3& b) {
    const float d = dot(a, b);
    return d < 0 ? -d : d;
}
constexpr Vec3 cross(const Vec3& a, const Vec3& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
constexpr float length_squared(const Vec3& a) { return dot(a, a); }
inline float length(const Vec3& a) { return std::sqrt(length_squared(a)); }
inline Vec3 normalize(const Vec3& a) { return a / length(a); }
inline bool is_finite(const Vec3& a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }
constexpr float largest_coordinate(const Vec3& a) {
    const float x = a.x < 0 ? -a.x : a.x, y = a.y < 0 ? -a.y : a.y, z = a.z < 0 ? -a.z : a.z;
    return x > y ? (x > z ? x : z) : (y > z ? y : z);
}
/// `v` flipped, if need be, into the hemisphere of `n`.
constexpr Vec3 face_forward(const Vec3& v, const Vec3& n) { return dot(v, n) < 0 ? -v : v; }

struct Rgb {
    float r = 0, g = 0, b = 0;

    constexpr Rgb() = default;
    constexpr explicit Rgb(float v) : r(v), g(v), b(v) {}
    constexpr Rgb(float red, float green, float blue) : r(red), g(green), b(blue) {}

    constexpr float operator[](int i) const { return i == 0 ? r : (i == 1 ? g : b); }
    constexpr Rgb& operator+=(const Rgb& o) {
        r += o.r, g += o.g, b += o.b;
        return *this;
    }
    constexpr Rgb& operator*=(const Rgb& o) {
        r *= o.r, g *= o.g, b *= o.b;
        return *this;
    }
    constexpr Rgb& operator*=(float s) {
        r *= s, g *= s, b *= s;
        return *this;
    }
    friend constexpr bool operator==(const Rgb&, const Rgb&) = default;

    constexpr bool is_black() const { return r == 0 && g == 0 && b == 0; }
    constexpr float max_component() const { return r > g ? (r > b ? r : b) : (g > b ? g : b); }
    constexpr float average() const { return (r + g + b) * (1.0f / 3.0f); }
    /// Rec.709 luminance.
    constexpr float luminance() const { return 0.2126f * r + 0.7152f * g + 0.0722f * b; }
};

constexpr Rgb operator+(const Rgb& a, const Rgb& b) { return {a.r + b.r, a.g + b.g, a.b + b.b}; }
constexpr Rgb operator-(const Rgb& a, const Rgb& b) { return {a.r - b.r, a.g - b.g, a.b - b.b}; }
constexpr Rgb operator*(const Rgb& a, const Rgb& b) { return {a.r * b.r, a.g * b.g, a.b * b.b}; }
constexpr Rgb operator*(const Rgb& a, float s) { return {a.r * s, a.g * s, a.b * s}; }
constexpr Rgb operator*(float s, const Rgb& a) { return a * s; }
constexpr Rgb operator/(const Rgb& a, float s) { return a * (1.0f / s); }
inline bool is_finite(const Rgb& a) { return std::isfinite(a.r) && std::isfinite(a.g) && std::isfinite(a.b); }

/// The one positive linear functional L(.) used wherever a colour must become a scalar (resampling weights, Q, Gamma,
/// MIS weights): Rec.709 luminance plus a little of the mean, so that no visible colour has weight zero.
constexpr float scalar_of(const Rgb& c) { return c.luminance() + 1e-3f * c.average(); }

/// Right-handed orthonormal frame around a unit normal `n` (the local z axis).
struct Frame {
    Vec3 s, t, n;

    Frame() = default;
    Frame(const Vec3& s_, const Vec3& t_, const Vec3& n_) : s(s_), t(t_), n(n_) {}
    /// Branch-free construction from a unit normal [Duff et al. 2017, Building an Orthonormal Basis, Revisited].
    explicit Frame(const Vec3& unit_normal) : n(unit_normal) {
        const float sign = std::copysign(1.0f, n.z);
        const float a = -1.0f / (sign + n.z);
        const float b = n.x * n.y * a;
        s = {1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x};
        t = {b, sign + n.y * n.y * a, -n.y};
    }
    Vec3 to_local(const Vec3& w) const { return {dot(w, s), dot(w, t), dot(w, n)}; }
    Vec3 to_world(const Vec3& w) const { return s * w.x + t * w.y + n * w.z; }
};

struct Bounds3 {
    Vec3 lo{1e30f, 1e30f, 1e30f}, hi{-1e30f, -1e30f, -1e30f};

    void extend(const Vec3& p) {
        lo = {p.x < lo.x ? p.x : lo.x, p.y < lo.y ? p.y : lo.y, p.z < lo.z ? p.z : lo.z};
        hi = {p.x > hi.x ? p.x : hi.x, p.y > hi.y ? p.y : hi.y, p.z > hi.z ? p.z : hi.z};
    }
    bool empty() const { return lo.x > hi.x; }
    Vec3 centre() const { return (lo + hi) * 0.5f; }
};

}  // namespace lightloom
