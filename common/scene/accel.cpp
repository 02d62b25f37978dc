#include "common/scene/accel.h"

#include <embree3/rtcore.h>
#include <tbb/global_control.h>

#include <atomic>
#include <cmath>
#include <cstring>

#include "common/core/math.h"
#include "common/core/rng.h"

namespace lightloom {
namespace {

std::atomic<int64_t> g_device_memory{0};

bool count_memory(void* user, ssize_t bytes, bool) {
    static_cast<std::atomic<int64_t>*>(user)->fetch_add(bytes, std::memory_order_relaxed);
    return true;
}

/// One device for the process, with a pinned instruction set. It must not be told a number of threads: that would be the
/// limit of every other task of the process as long as the device lives.
struct Device {
    RTCDevice handle = rtcNewDevice("isa=avx2,set_affinity=0,start_threads=0");
    Device() {
        if (handle != nullptr) rtcSetDeviceMemoryMonitorFunction(handle, count_memory, &g_device_memory);
    }
    ~Device() {
        if (handle != nullptr) rtcReleaseDevice(handle);
    }
};

RTCDevice device() {
    static Device d;
    return d.handle;
}

/// Builds on the calling thread alone (accel.h says why). Embree runs its builds in a task arena of its own, so the limit has
/// to be the process's; other tasks are merely slowed down while it lasts.
void commit(RTCScene scene) {
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    rtcCommitScene(scene);
}

RTCScene new_scene() {
    RTCScene s = rtcNewScene(device());
    rtcSetSceneBuildQuality(s, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(s, RTC_SCENE_FLAG_ROBUST);
    return s;
}

/// Whether Embree has built everything that was committed.
Status built() {
    if (const RTCError error = rtcGetDeviceError(device()); error != RTC_ERROR_NONE)
        return internal_error("Embree could not build the acceleration structure (error " + std::to_string(int(error)) +
                              "); the machine may be out of memory");
    return {};
}

struct GeometryUser {
    const void* opacity_user = nullptr;
    Accel::Opacity opacity = nullptr;
    int32_t object = -1;    // -1: the world, otherwise index into SceneDescription::objects
    uint32_t geometry = 0;  // index of the mesh in its object
    uint32_t first_instance_id = 0;
};

struct SphereUser {
    const std::vector<Sphere>* spheres = nullptr;
    GeometryUser filter;
};

/// Uniform in [0, 1) from the bits of a ray and a primitive.
float ray_hash(float ox, float oy, float oz, float dx, float dy, float dz, uint64_t primitive) {
    const auto bits = [](float a, float b) { return (uint64_t(std::bit_cast<uint32_t>(a)) << 32) | std::bit_cast<uint32_t>(b); };
    uint64_t h = mix64(bits(ox, oy) + 0x9e3779b97f4a7c15ull);
    h = mix64(h ^ bits(oz, dx));
    h = mix64(h ^ bits(dy, dz));
    h = mix64(h ^ primitive);
    return float(h >> 40) * 0x1p-24f;
}

/// `salt` tells apart the crossings of one primitive (the two of a sphere).
bool passes_through(const GeometryUser& g, uint32_t instance_id, uint32_t primitive, uint32_t salt, Vec2 uv, const Vec3& outward,
                    const RTCRay& ray) {
    const int32_t instance = instance_id == RTC_INVALID_GEOMETRY_ID ? -1 : int32_t(instance_id - g.first_instance_id);
    const float opacity = g.opacity(g.opacity_user, {g.object, instance, g.geometry, primitive, uv.x, uv.y, outward});
    if (opacity >= 1) return false;
    if (opacity <= 0) return true;
    // The object is part of the hash, too: a ray that crosses two objects through identity instances meets equal
    // geometry and primitive numbers.
    const uint64_t id = ((uint64_t(g.geometry * 2 + salt) << 32) | primitive) ^ mix64(uint64_t(g.object + 1));
    return ray_hash(ray.org_x, ray.org_y, ray.org_z, ray.dir_x, ray.dir_y, ray.dir_z, id) >= opacity;
}

void alpha_filter(const RTCFilterFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto& g = *static_cast<const GeometryUser*>(args->geometryUserPtr);
    const RTCRay& ray = *reinterpret_cast<const RTCRay*>(args->ray);
    const RTCHit& hit = *reinterpret_cast<const RTCHit*>(args->hit);
    if (passes_through(g, args->context->instID[0], hit.primID, 0, {hit.u, hit.v}, {}, ray)) args->valid[0] = 0;
}

/// Embree asks for bounds on threads of TBB and waits for them; both come without instrumentation, so that
/// ThreadSanitizer does not see that what a callback has read may be freed afterwards. This counter orders the two once
/// more, in a way that it does see.
std::atomic<uint64_t> bounds_asked{0};

void sphere_bounds(const RTCBoundsFunctionArguments* args) {
    const Sphere& s = (*static_cast<const SphereUser*>(args->geometryUserPtr)->spheres)[args->primID];
    const float r = s.radius * 1.00001f;
    *args->bounds_o = {s.centre.x - r, s.centre.y - r, s.centre.z - r, 0, s.centre.x + r, s.centre.y + r, s.centre.z + r, 0};
    bounds_asked.fetch_add(1, std::memory_order_release);
}

/// Both roots, `t` ascending. They are computed in double, because a sphere of glass is hit from inside at grazing
/// angles, where float cancels.
int sphere_roots(const Sphere& s, const RTCRay& ray, double t[2]) {
    const double ox = double(ray.org_x) - s.centre.x, oy = double(ray.org_y) - s.centre.y, oz = double(ray.org_z) - s.centre.z;
    const double dx = ray.dir_x, dy = ray.dir_y, dz = ray.dir_z, r = s.radius;
    const double a = dx * dx + dy * dy + dz * dz;
    const double b = ox * dx + oy * dy + oz * dz;
    // This form of the discriminant, by the perpendicular from the centre, does not cancel far from the sphere.
    const double px = ox - b / a * dx, py = oy - b / a * dy, pz = oz - b / a * dz;
    const double discriminant = r * r - (px * px + py * py + pz * pz);
    if (discriminant < 0) return 0;
    const double root = std::sqrt(a * discriminant);
    const double c = ox * ox + oy * oy + oz * oz - r * r;
    const double q = b > 0 ? -b - root : -b + root;
    if (q == 0) return 0;
    t[0] = q / a, t[1] = c / q;
    if (t[0] > t[1]) std::swap(t[0], t[1]);
    return 2;
}

bool sphere_passes(const SphereUser& user, uint32_t instance_id, uint32_t primitive, int crossing, double t, const RTCRay& ray) {
    if (user.filter.opacity == nullptr) return false;
    const Sphere& s = (*user.spheres)[primitive];
    if (s.attributes.alpha == kNone) return false;
    const Vec3 p{float(ray.org_x + t * ray.dir_x), float(ray.org_y + t * ray.dir_y), float(ray.org_z + t * ray.dir_z)};
    const Vec3 outward = normalize(p - s.centre);
    return passes_through(user.filter, instance_id, primitive, uint32_t(crossing), sphere_uv(s, outward), outward, ray);
}

void sphere_intersect(const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto& user = *static_cast<const SphereUser*>(args->geometryUserPtr);
    auto& rayhit = *reinterpret_cast<RTCRayHit*>(args->rayhit);
    double t[2];
    const int n = sphere_roots((*user.spheres)[args->primID], rayhit.ray, t);
    for (int i = 0; i < n; ++i) {
        if (!(t[i] > rayhit.ray.tnear && t[i] < rayhit.ray.tfar)) continue;
        const float t_hit = float(t[i]);
        if (sphere_passes(user, args->context->instID[0], args->primID, i, t[i], rayhit.ray)) continue;
        rayhit.ray.tfar = t_hit;
        rayhit.hit.geomID = args->geomID;
        rayhit.hit.primID = args->primID;
        rayhit.hit.instID[0] = args->context->instID[0];
        rayhit.hit.u = rayhit.hit.v = 0;
        rayhit.hit.Ng_x = rayhit.hit.Ng_y = rayhit.hit.Ng_z = 0;
        return;
    }
}

void sphere_occluded(const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    const auto& user = *static_cast<const SphereUser*>(args->geometryUserPtr);
    auto& ray = *reinterpret_cast<RTCRay*>(args->ray);
    double t[2];
    const int n = sphere_roots((*user.spheres)[args->primID], ray, t);
    for (int i = 0; i < n; ++i) {
        if (!(t[i] > ray.tnear && t[i] < ray.tfar)) continue;
        if (sphere_passes(user, args->context->instID[0], args->primID, i, t[i], ray)) continue;
        ray.tfar = -INFINITY;
        return;
    }
}

}  // namespace

Vec2 sphere_uv(const Frame& orientation, const Vec3& n) {
    const Vec3 local = orientation.to_local(n);
    double phi = math::atan2(local.y, local.x);
    if (phi < 0) phi += 2 * kPiD;
    return {float(phi / (2 * kPiD)), float(1 - math::acos(local.z) / kPiD)};
}

struct Accel::Impl {
    RTCScene world = nullptr, apart = nullptr;
    std::vector<RTCScene> objects;
    std::vector<std::unique_ptr<GeometryUser>> geometry_users;
    std::vector<std::unique_ptr<SphereUser>> sphere_users;
    uint32_t first_instance_id = 0;
    uint64_t memory = 0;

    ~Impl() {
        (void)bounds_asked.load(std::memory_order_acquire);
        if (world != nullptr) rtcReleaseScene(world);
        if (apart != nullptr) rtcReleaseScene(apart);
        for (RTCScene s : objects) rtcReleaseScene(s);
    }

    void add_meshes(RTCScene scene, const std::vector<TriangleMesh>& meshes, int32_t object, Opacity opacity, const void* user) {
        for (uint32_t i = 0; i < meshes.size(); ++i) add_mesh(scene, meshes, i, object, opacity, user);
    }

    void add_mesh(RTCScene scene, const std::vector<TriangleMesh>& meshes, uint32_t i, int32_t object, Opacity opacity,
                  const void* user) {
        const TriangleMesh& mesh = meshes[i];
        RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0, sizeof(Vec3),
                                   mesh.positions.size() - 1);  // the last vertex is padding
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.indices.data(), 0, 3 * sizeof(uint32_t),
                                   mesh.indices.size() / 3);
        if (mesh.attributes.alpha != kNone) {
            geometry_users.push_back(std::make_unique<GeometryUser>(GeometryUser{user, opacity, object, i, first_instance_id}));
            rtcSetGeometryUserData(g, geometry_users.back().get());
            rtcSetGeometryIntersectFilterFunction(g, alpha_filter);
            rtcSetGeometryOccludedFilterFunction(g, alpha_filter);
        }
        rtcCommitGeometry(g);
        rtcAttachGeometryByID(scene, g, i);
        rtcReleaseGeometry(g);
    }

    bool intersect(RTCScene scene, const Vec3& o, const Vec3& d, float t_min, float t_max, RawHit* hit) const {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRayHit r;
        r.ray = {o.x, o.y, o.z, t_min, d.x, d.y, d.z, 0, t_max, 0xffffffffu, 0, 0};
        r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &r);
        if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
        hit->t = r.ray.tfar;
        hit->primitive = r.hit.primID;
        hit->u = r.hit.u;
        hit->v = r.hit.v;
        hit->instance = instance_of(r.hit.instID[0]);
        hit->geometry = r.hit.geomID;
        return true;
    }

    int32_t instance_of(uint32_t id) const { return id != RTC_INVALID_GEOMETRY_ID ? int32_t(id - first_instance_id) : -1; }

    void add_spheres(RTCScene scene, const std::vector<Sphere>& spheres, uint32_t id, int32_t object, Opacity opacity,
                     const void* user) {
        if (spheres.empty()) return;
        bool any_alpha = false;
        for (const Sphere& s : spheres) any_alpha |= s.attributes.alpha != kNone;
        sphere_users.push_back(std::make_unique<SphereUser>());
        sphere_users.back()->spheres = &spheres;
        if (any_alpha) sphere_users.back()->filter = GeometryUser{user, opacity, object, kSphereGeometry, first_instance_id};
        RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(g, unsigned(spheres.size()));
        rtcSetGeometryUserData(g, sphere_users.back().get());
        rtcSetGeometryBoundsFunction(g, sphere_bounds, nullptr);
        rtcSetGeometryIntersectFunction(g, sphere_intersect);
        rtcSetGeometryOccludedFunction(g, sphere_occluded);
        rtcCommitGeometry(g);
        rtcAttachGeometryByID(scene, g, id);
        rtcReleaseGeometry(g);
    }
};

Accel::Accel() : impl_(std::make_unique<Impl>()) {}
Accel::~Accel() = default;

Result<std::unique_ptr<Accel>> Accel::build(const SceneDescription& scene, Opacity opacity, const void* opacity_user) {
    if (device() == nullptr)
        return failed_precondition("Embree has no device with the AVX2 instruction set here; run on an x86-64-v3 machine");
    std::unique_ptr<Accel> accel(new Accel);
    Impl& impl = *accel->impl_;
    impl.first_instance_id = uint32_t(scene.meshes.size()) + 1;
    const int64_t before = g_device_memory.load();
    for (int32_t o = 0; o < int32_t(scene.objects.size()); ++o) {
        RTCScene s = new_scene();
        impl.objects.push_back(s);
        impl.add_meshes(s, scene.objects[size_t(o)].meshes, o, opacity, opacity_user);
        impl.add_spheres(s, scene.objects[size_t(o)].spheres, uint32_t(scene.objects[size_t(o)].meshes.size()), o, opacity,
                         opacity_user);
        commit(s);
    }
    impl.world = new_scene();
    impl.add_meshes(impl.world, scene.meshes, -1, opacity, opacity_user);
    impl.add_spheres(impl.world, scene.spheres, uint32_t(scene.meshes.size()), -1, opacity, opacity_user);
    for (uint32_t i = 0; i < scene.instances.size(); ++i) {
        const Instance& instance = scene.instances[i];
        RTCGeometry g = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(g, impl.objects[size_t(instance.object)]);
        float m[12];
        for (int c = 0; c < 4; ++c)
            for (int r = 0; r < 3; ++r) m[c * 3 + r] = float(instance.object_to_world.m[r][c]);
        rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
        rtcCommitGeometry(g);
        rtcAttachGeometryByID(impl.world, g, impl.first_instance_id + i);
        rtcReleaseGeometry(g);
    }
    commit(impl.world);
    LL_RETURN_IF_ERROR(built());
    impl.memory = uint64_t(std::max<int64_t>(0, g_device_memory.load() - before));
    return accel;
}

Status Accel::keep_apart(const SceneDescription& scene, const std::vector<uint32_t>& meshes, Opacity opacity,
                         const void* opacity_user) {
    impl_->apart = new_scene();
    for (const uint32_t i : meshes) impl_->add_mesh(impl_->apart, scene.meshes, i, -1, opacity, opacity_user);
    commit(impl_->apart);
    return built();
}

bool Accel::intersect(const Vec3& o, const Vec3& d, float t_min, float t_max, RawHit* hit) const {
    return impl_->intersect(impl_->world, o, d, t_min, t_max, hit);
}

bool Accel::intersect_apart(const Vec3& o, const Vec3& d, float t_min, float t_max, RawHit* hit) const {
    return impl_->intersect(impl_->apart, o, d, t_min, t_max, hit);
}

void Accel::for_each_near(const Vec3& centre, float radius, const std::function<bool(const RawHit&)>& visit) const {
    struct Visitor {
        const Impl& impl;
        const std::function<bool(const RawHit&)>& visit;
        bool done = false;
    } visitor{*impl_, visit};
    RTCPointQuery query{centre.x, centre.y, centre.z, 0, radius};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    const auto found = [](RTCPointQueryFunctionArguments* args) {
        auto& v = *static_cast<Visitor*>(args->userPtr);
        if (v.done) return false;
        RawHit at;
        at.geometry = args->geomID;
        at.primitive = args->primID;
        at.instance = args->context->instStackSize > 0 ? v.impl.instance_of(args->context->instID[0]) : -1;
        v.done = !v.visit(at);
        if (!v.done) return false;  // the search radius stays the same
        args->query->radius = 0;
        return true;
    };
    rtcPointQuery(impl_->world, &query, &context, found, &visitor);
}

bool Accel::occluded(const Vec3& o, const Vec3& d, float t_max) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay r{o.x, o.y, o.z, 0, d.x, d.y, d.z, 0, t_max, 0xffffffffu, 0, 0};
    rtcOccluded1(impl_->world, &context, &r);
    return r.tfar < 0;
}

Bounds3 Accel::bounds() const {
    RTCBounds b;
    rtcGetSceneBounds(impl_->world, &b);
    Bounds3 r;
    if (b.lower_x > b.upper_x) return r;
    r.lo = {b.lower_x, b.lower_y, b.lower_z};
    r.hi = {b.upper_x, b.upper_y, b.upper_z};
    return r;
}

uint64_t Accel::memory_bytes() const { return impl_->memory; }

}  // namespace lightloom
