#pragma once
// One of each kind of emitter, with what it takes besides, its flux, and where points and directions fall into cells.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/core/math.h"
#include "common/scene/emitter.h"

namespace lightloom::testing {

inline Emitter triangle(bool two_sided) {
    Emitter e;
    e.kind = EmitterKind::kTriangle;
    e.two_sided = two_sided;
    e.radiance = {3, 2, 1};
    e.position = {0.2f, 1, -0.3f};
    e.edge1 = {0.8f, 0.1f, 0.2f};
    e.edge2 = {-0.1f, 0.3f, 0.9f};
    const Vec3 n = cross(e.edge1, e.edge2);
    e.normal = normalize(n);
    e.inv_area = 2 / length(n);
    return e;
}

inline Emitter sphere(bool inward, bool two_sided = false) {
    Emitter e;
    e.kind = EmitterKind::kSphere;
    e.inward = inward;
    e.two_sided = two_sided;
    e.radiance = {1, 2, 4};
    e.position = {-0.5f, 0.4f, 0.7f};
    e.radius = 0.6f;
    e.inv_area = 1 / (4 * kPi * e.radius * e.radius);
    return e;
}

inline Emitter hidden(Emitter e) {
    e.hidden = true;
    return e;
}

inline Emitter point() {
    Emitter e;
    e.kind = EmitterKind::kPoint;
    e.radiance = {5, 6, 7};
    e.position = {0.1f, 0.2f, 0.3f};
    return e;
}

inline Emitter spot() {
    Emitter e = point();
    e.kind = EmitterKind::kSpot;
    e.normal = normalize(Vec3{0.3f, -1, 0.2f});
    e.total_height = 0.4f, e.falloff_height = 0.2f;
    return e;
}

inline Emitter distant() {
    Emitter e;
    e.kind = EmitterKind::kDistant;
    e.radiance = {2, 3, 4};
    e.normal = normalize(Vec3{0.2f, -0.7f, 0.5f});
    return e;
}

inline Emitter environment() {
    Emitter e;
    e.kind = EmitterKind::kEnvironment;
    return e;
}

/// 0 nothing, 1 constant, 2 image, 3 both (the image twice, rotated differently).
struct EnvironmentCase {
    std::vector<InfiniteLight> lights;
    std::vector<Image> images;

    explicit EnvironmentCase(int which) {
        Image map;
        map.width = map.height = 8;
        for (int i = 0; i < 64; ++i)
            map.floats.insert(map.floats.end(), {0.1f * float(i % 7), 0.3f * float(i % 2), float(i == 20) * 9});
        images.push_back(map);
        InfiniteLight image, constant, turned;
        image.image = turned.image = 0;
        image.light_to_world = rotation(40, 1, 1, 0);
        turned.light_to_world = rotation(130, 0, 1, 0.3) * scaling(-1, 1, 1);
        turned.radiance = {0.5f, 2, 0.1f};
        constant.radiance = {0.2f, 0.3f, 0.1f};
        if (which & 1) lights.push_back(constant);
        if (which & 2) lights.push_back(image);
        if (which == 3) lights.push_back(turned);
    }
    Environment make() const { return Environment(lights, images); }
};

inline constexpr Vec3 kCentre{0.5f, -0.25f, 1};
inline constexpr float kRadius = 3;

struct Case {
    std::string name;
    Emitter emitter;
    int environment;
    LightMaps maps = {};
};

/// Shows two fifths of an image on a triangle, or all of it on a sphere.
inline Case pictured(std::string name, Emitter e) {
    static const Image image = [] {
        Image picture;
        picture.width = 5, picture.height = 4;
        for (int i = 0; i < 20; ++i)
            picture.floats.insert(picture.floats.end(),
                                  {0.2f + float(i % 3), 0.5f + 0.2f * float(i / 5), float(i == 7) * 4 + 0.1f});
        return picture;
    }();
    const Vec2 uv[3] = {{0.1f, 0.2f}, {0.9f, 0.1f}, {0.3f, 1.2f}};
    e.map = 0;
    Case c{std::move(name), e, 0};
    if (e.kind == EmitterKind::kSphere)
        c.maps.surfaces.emplace_back(image, image.mean(), Frame(normalize(Vec3{0.3f, 0.5f, -0.2f})));
    else
        c.maps.surfaces.emplace_back(image, image.mean(), uv);
    return c;
}

/// A slide that is projected upwards, or light all around; dark texels among others.
inline Case directed(std::string name, EmitterKind kind) {
    static const Image image = [] {
        Image picture;
        picture.width = picture.height = 4;
        for (int i = 0; i < 16; ++i)
            picture.floats.insert(picture.floats.end(), {float(i % 3), 0.5f * float(i % 2), i == 5 ? 6.0f : 0.0f});
        return picture;
    }();
    Emitter e = point();
    e.kind = kind;
    e.map = 0;
    Case c{std::move(name), e, 0};
    const Mat4 turn = rotation(50, 1, 2, 0.5) * scaling(-2, 2, 2);
    c.maps.directions.push_back(kind == EmitterKind::kProjection ? DirectionMap::projection(image, turn, 0.8f, 1.1f)
                                                                 : DirectionMap::goniometric(image, turn));
    return c;
}

inline std::vector<Case> cases() {
    return {{"triangle", triangle(false), 0},
            {"two-sided triangle", triangle(true), 0},
            {"sphere", sphere(false), 0},
            {"two-sided sphere", sphere(false, true), 0},
            {"inward sphere", sphere(true), 0},
            {"hidden sphere", hidden(sphere(false)), 0},
            {"hidden two-sided sphere", hidden(sphere(false, true)), 0},
            pictured("pictured two-sided triangle", triangle(true)),
            pictured("pictured sphere", sphere(false)),
            {"point", point(), 0},
            {"spot", spot(), 0},
            directed("projection", EmitterKind::kProjection),
            directed("goniometric", EmitterKind::kGoniometric),
            {"distant", distant(), 0},
            {"constant environment", environment(), 1},
            {"image environment", environment(), 2},
            {"mixed environment", environment(), 3}};
}

/// Total flux per channel, W.
inline Rgb flux(const Case& c) {
    const Emitter& e = c.emitter;
    const float disc = kPi * kRadius * kRadius;
    if (!c.maps.surfaces.empty()) {  // the mean of many points, whose radiance is that of emitted()
        const EmitterSet set({e}, Environment(), kCentre, kRadius, c.maps);
        double sum[3] = {};
        constexpr int kSide = 600;
        for (int i = 0; i < kSide * kSide; ++i) {
            const Vec2 u{(float(i % kSide) + 0.5f) / kSide, (float(i / kSide) + 0.5f) / kSide}, b = sample_triangle(u);
            const Vec3 n = e.kind == EmitterKind::kSphere ? sample_sphere(u) : e.normal;
            const Vec3 p = e.kind == EmitterKind::kSphere ? e.position + n * e.radius : e.position + e.edge1 * b.x + e.edge2 * b.y;
            const Rgb radiance = set.emitted(e, p, n, n);
            for (int k = 0; k < 3; ++k) sum[k] += double(radiance[k]) / (kSide * kSide);
        }
        return Rgb{float(sum[0]), float(sum[1]), float(sum[2])} * (kPi / e.inv_area * (e.two_sided ? 2.0f : 1.0f));
    }
    // Of sampling that has no variance: exactly.
    if (e.kind == EmitterKind::kGoniometric) return e.radiance * (c.maps.directions[0].mean() * (4 * kPi));
    if (!c.maps.directions.empty()) {
        const EmitterSet set({e}, Environment(), kCentre, kRadius, c.maps);
        double sum[3] = {};
        constexpr int kSide = 2000;
        for (int i = 0; i < kSide * kSide; ++i) {
            const Vec3 w = sample_sphere({(float(i % kSide) + 0.5f) / kSide, (float(i / kSide) + 0.5f) / kSide});
            const Rgb intensity = set.emitted(e, e.position, w, w);
            for (int k = 0; k < 3; ++k) sum[k] += double(intensity[k]) * (4 * kPiD / kSide / kSide);
        }
        return {float(sum[0]), float(sum[1]), float(sum[2])};
    }
    switch (e.kind) {
        case EmitterKind::kTriangle:
        case EmitterKind::kSphere: return e.radiance * (kPi / e.inv_area * (e.two_sided ? 2.0f : 1.0f));
        case EmitterKind::kPoint: return e.radiance * (4 * kPi);
        // The smoothstep between the two cosines averages one half.
        case EmitterKind::kSpot: return e.radiance * (kPi * (e.total_height + e.falloff_height));
        case EmitterKind::kDistant: return e.radiance * disc;
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric:
        case EmitterKind::kEnvironment: break;
    }
    const EnvironmentCase source(c.environment);
    Rgb sum;
    for (const InfiniteLight& light : source.lights) {
        Rgb mean = light.image == kNone ? Rgb(1.0f) : Rgb{};
        if (light.image != kNone)
            for (int i = 0; i < 64; ++i) mean += source.images[0].texel(i % 8, i / 8) / 64;
        sum += light.radiance * mean * (4 * kPi * disc);
    }
    return sum;
}

/// A bin on a sphere of directions or on a disc: equal-area cells in (height, azimuth).
struct Cells {
    int rows, columns;
    int count() const { return rows * columns; }
    /// `height` in [0, 1), azimuth of (x, y).
    int of(double height, double x, double y) const {
        const int row = std::clamp(int(height * rows), 0, rows - 1);
        const double turns = std::atan2(y, x) / (2 * kPiD) + 0.5;
        return row * columns + std::clamp(int(turns * columns), 0, columns - 1);
    }
};

/// Which cell of four equal parts a point of a triangle lies in.
inline int quarter_of(const Emitter& e, const Vec3& p) {
    const Vec3 n = cross(e.edge1, e.edge2), d = p - e.position;
    const float n2 = length_squared(n), b1 = dot(cross(d, e.edge2), n) / n2, b2 = dot(cross(e.edge1, d), n) / n2;
    return b1 > 0.5f ? 1 : b2 > 0.5f ? 2 : b1 + b2 < 0.5f ? 0 : 3;
}

/// A stand-in reference emitter keeps the pmf of the tested one away from 1, so that a missing pmf
/// is noticed.
inline EmitterSet set_of(const Case& c, const EnvironmentCase& source) {
    Emitter other = point();
    other.radiance = Rgb(40.0f);
    return EmitterSet({c.emitter, other}, c.environment != 0 ? source.make() : Environment(), kCentre, kRadius, c.maps);
}

}  // namespace lightloom::testing
