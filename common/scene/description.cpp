#include "common/scene/description.h"

#include <cmath>

#include "common/core/math.h"

namespace lightloom {
namespace {

std::string at(const ShapeAttributes& a) { return a.source.empty() ? std::string("shape") : a.source; }

std::string at(const InfiniteLight& l) { return l.source.empty() ? std::string("infinite light") : l.source; }

std::string at(const ImageLight& l) { return l.source.empty() ? std::string("image light") : l.source; }

bool rgb_ok(const Rgb& c) { return is_finite(c) && c.r >= 0 && c.g >= 0 && c.b >= 0; }

struct Checker {
    const SceneDescription& d;

    Status attributes(const ShapeAttributes& a, bool may_emit) const {
        if (a.material < 0 || size_t(a.material) >= d.materials.size()) return invalid_argument(at(a) + ": no such material");
        if (a.emission != kNone && (a.emission < 0 || size_t(a.emission) >= d.emissions.size()))
            return invalid_argument(at(a) + ": no such area emission");
        if (a.emission != kNone && !may_emit) return invalid_argument(at(a) + ": a shape inside an object definition may not emit");
        if (a.emission != kNone && a.alpha != kNone && !d.emissions[size_t(a.emission)].radiance.is_black())
            return invalid_argument(at(a) +
                                    ": a shape that emits may not have an alpha, because the light sampled on it "
                                    "would be that of the uncut shape; cut the geometry instead");
        if (a.alpha != kNone && (a.alpha < 0 || size_t(a.alpha) >= d.textures.size()))
            return invalid_argument(at(a) + ": no such alpha texture");
        return {};
    }

    Status mesh(const TriangleMesh& m, bool may_emit) const {
        LL_RETURN_IF_ERROR(attributes(m.attributes, may_emit));
        const std::string where = at(m.attributes);
        if (m.indices.size() % 3 != 0) return invalid_argument(where + ": the index count is not a multiple of three");
        if (m.positions.size() >= 0xffffffffull) return invalid_argument(where + ": too many vertices");
        if (!m.normals.empty() && m.normals.size() != m.positions.size())
            return invalid_argument(where + ": normals and positions differ in number");
        if (!m.uvs.empty() && m.uvs.size() != m.positions.size())
            return invalid_argument(where + ": texture coordinates and positions differ in number");
        for (const uint32_t i : m.indices)
            if (i >= m.positions.size())
                return invalid_argument(where + ": vertex index " + std::to_string(i) + " is out of range (" +
                                        std::to_string(m.positions.size()) + " vertices)");
        for (const Vec3& p : m.positions)
            if (!is_finite(p)) return invalid_argument(where + ": a vertex position is not finite");
        for (size_t i = 0; i < m.indices.size(); i += 3) {
            const Vec3 &a = m.positions[m.indices[i]], &b = m.positions[m.indices[i + 1]], &c = m.positions[m.indices[i + 2]];
            if (!std::isfinite(length_squared(cross(b - a, c - a))))
                return invalid_argument(where + ": triangle " + std::to_string(i / 3) +
                                        " is too large: its area is beyond single precision; make the scene smaller");
        }
        for (const Vec3& n : m.normals)
            if (!is_finite(n)) return invalid_argument(where + ": a vertex normal is not finite");
        return {};
    }

    Status sphere(const Sphere& s, bool may_emit) const {
        LL_RETURN_IF_ERROR(attributes(s.attributes, may_emit));
        if (!is_finite(s.centre) || !(s.radius > 0) || !std::isfinite(s.radius))
            return invalid_argument(at(s.attributes) + ": a sphere needs a finite centre and a positive radius");
        const float area = 4 * kPi * s.radius * s.radius;
        if (!std::isfinite(area) || !std::isfinite(1 / area))
            return invalid_argument(at(s.attributes) + ": the sphere is too " + (area > 1 ? "large" : "small") +
                                    ": its area is beyond single precision; scale the scene");
        return {};
    }
};

}  // namespace

bool keeps_angles(const Mat4& transformation) {
    const auto& m = transformation.m;
    const auto column = [&](int j) { return Vec3{float(m[0][j]), float(m[1][j]), float(m[2][j])}; };
    const float sx = length(column(0)), sy = length(column(1)), sz = length(column(2));
    const Vec3 x = column(0) / sx, y = column(1) / sy, z = column(2) / sz;
    constexpr float kTolerance = 1e-4f;
    return std::fabs(sx / sz - 1) <= kTolerance && std::fabs(sy / sz - 1) <= kTolerance && abs_dot(x, y) <= kTolerance &&
           abs_dot(x, z) <= kTolerance && abs_dot(y, z) <= kTolerance;
}

Status validate(const SceneDescription& description) {
    const Checker checker{description};
    for (const TriangleMesh& m : description.meshes) LL_RETURN_IF_ERROR(checker.mesh(m, true));
    for (const Sphere& s : description.spheres) LL_RETURN_IF_ERROR(checker.sphere(s, true));
    for (const TriangleMesh& m : description.hidden_meshes) LL_RETURN_IF_ERROR(checker.mesh(m, true));
    for (const Sphere& s : description.hidden_spheres) LL_RETURN_IF_ERROR(checker.sphere(s, true));
    for (const ObjectDefinition& o : description.objects) {
        for (const TriangleMesh& m : o.meshes) LL_RETURN_IF_ERROR(checker.mesh(m, false));
        for (const Sphere& s : o.spheres) LL_RETURN_IF_ERROR(checker.sphere(s, false));
    }
    for (const Instance& i : description.instances) {
        if (i.object < 0 || size_t(i.object) >= description.objects.size())
            return invalid_argument(i.source + ": no such object to instance");
        if (!inverse(i.object_to_world)) return invalid_argument(i.source + ": the instance's transformation is singular");
    }
    for (const AreaEmission& e : description.emissions) {
        if (!rgb_ok(e.radiance)) return invalid_argument("an area light's radiance is negative or not finite");
        if (e.image != kNone && (size_t(e.image) >= description.images.size() || description.images[size_t(e.image)].empty()))
            return invalid_argument("an area light's image is missing or empty");
    }
    for (const ImageLight& l : description.image_lights) {
        if (!rgb_ok(l.intensity)) return invalid_argument(at(l) + ": the light's intensity is negative or not finite");
        if (!inverse(l.light_to_world)) return invalid_argument(at(l) + ": the light's transformation is singular");
        if (l.image < 0 || size_t(l.image) >= description.images.size() || description.images[size_t(l.image)].empty())
            return invalid_argument(at(l) + ": the light's image is missing or empty");
    }
    for (const InfiniteLight& l : description.infinite_lights) {
        if (!rgb_ok(l.radiance)) return invalid_argument(at(l) + ": the light's radiance is negative or not finite");
        if (!inverse(l.light_to_world)) return invalid_argument(at(l) + ": the light's transformation is singular");
        if (l.image != kNone && (size_t(l.image) >= description.images.size() || description.images[size_t(l.image)].empty()))
            return invalid_argument(at(l) + ": the light's image is missing or empty");
    }
    return {};
}

}  // namespace lightloom
