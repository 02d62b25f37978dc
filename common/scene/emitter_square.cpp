#include "common/scene/emitter_square.h"

#include <cmath>

#include "common/core/math.h"
#include "common/scene/sampling.h"

namespace lightloom {
namespace {

double dot_in_double(const Vec3& a, const Vec3& b) {
    return double(a.x) * double(b.x) + double(a.y) * double(b.y) + double(a.z) * double(b.z);
}

}  // namespace

Vec2 emitter_square(const Emitter& e, const Vec3& position, const Vec3& w) {
    switch (e.kind) {
        case EmitterKind::kTriangle: {
            // The edges of a narrow triangle are nearly parallel: single precision would leave little of the determinant.
            const Vec3 d = position - e.position;
            const double a = dot_in_double(e.edge1, e.edge1), b = dot_in_double(e.edge1, e.edge2),
                         c = dot_in_double(e.edge2, e.edge2);
            const double p = dot_in_double(d, e.edge1), q = dot_in_double(d, e.edge2);
            const double determinant = a * c - b * b;
            if (!(determinant > 0)) return {};
            const double b1 = (c * p - b * q) / determinant, b2 = (a * q - b * p) / determinant;
            const double sum = b1 + b2;
            return {clamp(float(sum * sum), 0.0f, 1.0f), sum > 0 ? clamp(float(b2 / sum), 0.0f, 1.0f) : 0};
        }
        case EmitterKind::kSphere: {
            const Vec3 n = (position - e.position) / e.radius;
            return {clamp(0.5f + 0.5f * n.z, 0.0f, 1.0f), 0.5f + float(math::atan2(n.y, n.x)) / kTwoPi};
        }
        case EmitterKind::kEnvironment: return equal_area_sphere_to_square(-w);
        case EmitterKind::kPoint:
        case EmitterKind::kSpot:
        case EmitterKind::kDistant:
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: return {};
    }
    return {};
}

Vec3 point_in_square(const Emitter& e, Vec2 p, Vec3* normal) {
    if (e.kind == EmitterKind::kTriangle) {
        const float sum = std::sqrt(p.x), b2 = p.y * sum;
        *normal = e.normal;
        return e.position + e.edge1 * (sum - b2) + e.edge2 * b2;
    }
    const float z = 2 * p.x - 1, r = safe_sqrt(1 - z * z);
    const math::SinCos sc = math::sincos_turns(double(p.y) - 0.5);
    const Vec3 n{r * float(sc.cos), r * float(sc.sin), z};
    *normal = e.inward ? -n : n;
    return e.position + n * e.radius;
}

}  // namespace lightloom
