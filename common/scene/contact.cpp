#include "common/scene/contact.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lightloom {
namespace {

constexpr double kZero = 0x1p-21;       // times a plane's rounding scale: four to eight units in the last place
constexpr double kClearance = 0x1p-16;  // times the same scale: farther away even a grazing ray has left the surface

struct Point {
    double x, y, z;

    Point(const Vec3& p) : x(double(p.x)), y(double(p.y)), z(double(p.z)) {}  // NOLINT(google-explicit-constructor)
    Point(double px, double py, double pz) : x(px), y(py), z(pz) {}
    friend Point operator-(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend double dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
    friend Point cross(const Point& a, const Point& b) {
        return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    }
    Point unit() const {
        const double len = std::sqrt(dot(*this, *this));
        return {x / len, y / len, z / len};
    }
};

/// A triangle with computations in double precision, so that only the rounding of the corners matters, and not that of
/// the computation.
struct Triangle {
    Vec3 corners[3];
    Point normal{0, 0, 1};

    void set_normal() { normal = cross(Point(corners[1]) - corners[0], Point(corners[2]) - corners[0]).unit(); }
    double height(const Vec3& p) const { return dot(Point(p) - corners[0], normal); }
    /// Unit vector in the plane that points out of the edge from corner i.
    Point edge_normal(int i) const { return cross(Point(corners[(i + 1) % 3]) - corners[i], normal).unit(); }
    /// The rounding scale of the plane, by which the relative rounding of coordinates is multiplied: zero for a ground
    /// at y = 0, however wide it is, and for a tilted plane its extent.
    double scale() const {
        double sum = 0;
        for (const Vec3& c : corners)
            sum = std::max(
                sum, std::fabs(normal.x * double(c.x)) + std::fabs(normal.y * double(c.y)) + std::fabs(normal.z * double(c.z)));
        return sum;
    }
    double scale_of(const Vec3& p) const {
        return std::fabs(normal.x * double(p.x)) + std::fabs(normal.y * double(p.y)) + std::fabs(normal.z * double(p.z));
    }
};

double distance_to_plane(const Triangle& t, const Triangle& other) {
    double most = 0;
    for (const Vec3& p : other.corners) most = std::max(most, std::fabs(t.height(p)));
    return most;
}

/// Whether the projections on `axis` overlap by more than `least`.
bool overlap(const Triangle& a, const Triangle& b, const Point& axis, double least) {
    const auto range = [&](const Triangle& t) {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (const Vec3& c : t.corners) {
            const double at = dot(Point(c) - a.corners[0], axis);
            low = std::min(low, at), high = std::max(high, at);
        }
        return std::pair(low, high);
    };
    const auto [a_low, a_high] = range(a);
    const auto [b_low, b_high] = range(b);
    return std::min(a_high, b_high) - std::max(a_low, b_low) > least;
}

/// Whether two triangles share a part of one plane.
bool coincide(const Triangle& a, const Triangle& b, double zero) {
    // The plane of the larger triangle is known better.
    if (std::min(distance_to_plane(a, b), distance_to_plane(b, a)) > zero) return false;
    for (int i = 0; i < 3; ++i)
        if (!overlap(a, b, a.edge_normal(i), zero) || !overlap(a, b, b.edge_normal(i), zero)) return false;
    return true;
}

bool touches(const Triangle& t, const Vec3& p, double zero) {
    if (std::fabs(t.height(p)) > zero) return false;
    for (int i = 0; i < 3; ++i)
        if (dot(Point(p) - t.corners[i], t.edge_normal(i)) > zero) return false;
    return true;
}

}  // namespace

ContactFinder::ContactFinder(const SceneDescription& scene, const Accel& accel, const std::vector<Mat4>& instance_inverse,
                             float largest)
    : scene_(scene),
      accel_(accel),
      instance_inverse_(instance_inverse),
      largest_(largest) {}

namespace {

/// Gets a triangle in world space; false for a sphere.
bool world_triangle(const SceneDescription& scene, const RawHit& at, Triangle* out) {
    const Instance* instance = at.instance >= 0 ? &scene.instances[size_t(at.instance)] : nullptr;
    const auto& meshes = instance ? scene.objects[size_t(instance->object)].meshes : scene.meshes;
    if (at.geometry >= meshes.size()) return false;
    const TriangleMesh& mesh = meshes[at.geometry];
    for (size_t i = 0; i < 3; ++i) {
        out->corners[i] = mesh.positions[mesh.indices[size_t(at.primitive) * 3 + i]];
        if (instance) out->corners[i] = instance->object_to_world.point(out->corners[i]);
    }
    out->set_normal();
    return true;
}

}  // namespace

float ContactFinder::clearance(const Vec3& p) const {
    double clearance = 0;
    const double own = std::max(double(largest_coordinate(p)), double(std::min(largest_, kSmallScene)));
    accel_.for_each_near(p, float(kZero * std::max(double(largest_), own) * std::sqrt(3.0)), [&](const RawHit& at) {
        Triangle t;
        if (world_triangle(scene_, at, &t)) {
            const double scale = std::max(t.scale(), t.scale_of(p));
            if (touches(t, p, kZero * scale)) clearance = std::max(clearance, kClearance * std::max(scale, own));
            return true;
        }
        const Instance* instance = at.instance >= 0 ? &scene_.instances[size_t(at.instance)] : nullptr;
        const Sphere& s = (instance ? scene_.objects[size_t(instance->object)].spheres : scene_.spheres)[at.primitive];
        const Vec3 inside = instance ? instance_inverse_[size_t(at.instance)].point(p) : p;
        const Vec3 from_centre = inside - s.centre;
        const float distance = length(from_centre);
        if (!(distance > 0)) return true;
        Vec3 nearest = s.centre + from_centre * (s.radius / distance);
        if (instance) nearest = instance->object_to_world.point(nearest);
        const double scale = std::max(own, double(largest_coordinate(nearest)) + double(s.radius));
        if (double(length(nearest - p)) <= kZero * scale) clearance = std::max(clearance, kClearance * scale);
        return true;
    });
    return float(clearance);
}

void ContactFinder::for_each_near(const Vec3 (&corners)[3], int level, const std::function<void(const RawHit&)>& visit) const {
    constexpr int kLevels = 8;
    constexpr size_t kMany = 128;
    const Vec3 centre = (corners[0] + corners[1] + corners[2]) / 3;
    float extent = 0;
    for (const Vec3& c : corners) extent = std::max(extent, length(c - centre));
    const float least = float(kZero * double(largest_)), radius = 1.001f * std::max(extent, least);
    // A triangle that is hardly larger than the least ball gains nothing by being divided.
    if (level == kLevels || extent < 4 * least) {
        accel_.for_each_near(centre, radius, [&](const RawHit& at) {
            visit(at);
            return true;
        });
        return;
    }
    std::vector<RawHit> found;
    accel_.for_each_near(centre, radius, [&](const RawHit& at) {
        found.push_back(at);
        return found.size() <= kMany;
    });
    if (found.size() <= kMany) {
        for (const RawHit& at : found) visit(at);
        return;
    }
    const Vec3 middle[3] = {(corners[1] + corners[2]) * 0.5f, (corners[2] + corners[0]) * 0.5f, (corners[0] + corners[1]) * 0.5f};
    for (int i = 0; i < 3; ++i) for_each_near({corners[i], middle[(i + 2) % 3], middle[(i + 1) % 3]}, level + 1, visit);
    for_each_near(middle, level + 1, visit);
}

float ContactFinder::clearance(const Vec3& corner, const Vec3& edge1, const Vec3& edge2) const {
    double clearance = 0;
    const Vec3 opposite = corner + edge1 + edge2;
    for (Triangle own : {Triangle{{corner, corner + edge1, opposite}}, Triangle{{corner, opposite, corner + edge2}}}) {
        own.set_normal();
        for_each_near(own.corners, 0, [&](const RawHit& at) {
            Triangle t;
            if (!world_triangle(scene_, at, &t)) return;
            const double scale = std::max(t.scale(), own.scale());
            if (coincide(own, t, kZero * scale)) clearance = std::max(clearance, kClearance * scale);
        });
    }
    return float(clearance);
}

ContactFinder::Covered ContactFinder::cover(std::vector<Emitter>* emitters, const std::function<bool(uint32_t)>& emits) const {
    Covered covered{std::vector<float>(scene_.meshes.size()), std::vector<float>(scene_.instances.size())};
    for (Emitter& e : *emitters) {
        if (e.kind != EmitterKind::kTriangle) continue;
        Triangle own{{e.position, e.position + e.edge1, e.position + e.edge2}};
        own.set_normal();
        float reach = e.reach;
        for_each_near(own.corners, 0, [&](const RawHit& at) {
            Triangle t;
            if (!world_triangle(scene_, at, &t) || (at.instance < 0 && emits(at.geometry))) return;
            const double scale = std::max(t.scale(), own.scale());
            if (!coincide(own, t, kZero * scale)) return;
            reach = std::max(reach, float(scale));
            if (e.hidden) return;  // no ray meets the emitter
            float& gap = at.instance < 0 ? covered.meshes[at.geometry] : covered.instances[size_t(at.instance)];
            gap = std::max(gap, float(4 * kZero) * std::max(float(scale), e.reach));
            covered.any = true;
        });
        e.reach = reach;
    }
    return covered;
}

}  // namespace lightloom
