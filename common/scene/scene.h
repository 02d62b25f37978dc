#pragma once
// Scene: immutable once built, safe to read from any number of threads.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/film/frame.h"
#include "common/scene/accel.h"
#include "common/scene/camera.h"
#include "common/scene/contact.h"
#include "common/scene/description.h"
#include "common/scene/emitter.h"
#include "common/scene/texture.h"

namespace lightloom {

struct SceneOptions {
    int width = 0, height = 0;  ///< Override of the film's resolution; 0 keeps the scene's. A crop window is scaled along.
    Rect crop = {};             ///< Window in pixels of that resolution, in place of the film's; all zeros keep the film's.
};

/// kInvalidArgument, naming the size, unless the window holds a pixel and lies in a frame of so many pixels.
Status check_crop(const Rect& crop, int width, int height);

/// The frame that a film makes with these options; kInvalidArgument if it is empty or too large.
Result<FrameLayout> frame_layout(const FilmDescription& film, const SceneOptions& options);

/// The facts that `lightloom inspect` prints.
struct SceneSummary {
    uint64_t triangle_count = 0;            ///< As stored (an instanced object counts once).
    uint64_t instanced_triangle_count = 0;  ///< As seen (every instance counts).
    uint64_t sphere_count = 0, instance_count = 0, emissive_triangle_count = 0;
    uint64_t texture_count = 0, image_bytes = 0, geometry_bytes = 0, acceleration_bytes = 0;
    double build_seconds = 0;
    struct Light {
        std::string kind;   ///< area, point, spot, distant, infinite, projection, goniometric
        std::string where;  ///< file:line where known
        double power = 0;   ///< Flux, W, as luminance within 0.1 %; lights are selected in proportion to it.
        uint64_t primitives = 0;
    };
    std::vector<Light> lights;
};

/// A point on a surface, in world space.
struct SurfacePoint {
    Vec3 p;
    Vec3 ng;        ///< Geometric normal, unit; outside as the scene defines it.
    Frame shading;  ///< Shading frame, n in the hemisphere of ng (except emitters whose normals point inwards).
    Vec2 uv;
    MaterialId material = kNone;
    int32_t emitter = kNone;
    /// Largest coordinate magnitude of the primitive, world space, and at least Scene's least_reach_; see offset_origin().
    float reach = 0;
};

class Scene {
  public:
    Scene& operator=(const Scene&) = delete;

    /// Takes over the description. What validate() refuses fails with one clear line, which names the shape's place in
    /// the file.
    static Result<std::unique_ptr<Scene>> build(SceneDescription description, const SceneOptions& options = {});

    /// The same scene, with light sub-paths that leave the lights as the table says (EmitterSet::guide_emission()). It shares the
    /// geometry of this one, which must outlive it.
    std::unique_ptr<const Scene> with_emission(std::shared_ptr<const EmissionTable> table) const;

    const SceneSummary& summary() const { return summary_; }
    const SceneDescription& description() const { return *description_; }
    const Camera& camera() const { return camera_; }
    const EmitterSet& emitters() const { return emitters_; }
    const FrameLayout& frame() const { return frame_; }

    // Where rays end: a ray that leaves a surface starts from offset_origin(); one that leaves a lens or lamp starts at
    // that end's clearance, within which nothing exists for its rays (contact.h). The segment between two ends is
    // shortened by the same lengths, whichever end it is traced from.

    /// Closest surface along the unit direction `d` from `o`, farther than `clearance`. Where an area light lies in the
    /// plane of the surface that was hit, the hit is on the light.
    bool intersect(const Vec3& o, const Vec3& d, SurfacePoint* out, float clearance = 0) const;
    /// The material of a point, textures looked up.
    Bsdf bsdf_at(const SurfacePoint& point) const;
    /// Whether the open segment between two surface points is blocked; both ends are moved off their surfaces.
    bool occluded(const Vec3& p, const Vec3& ng_p, float reach_p, const Vec3& q, const Vec3& ng_q, float reach_q) const;
    /// The same where `q` is not on a surface (a lens, a point light, a point beyond the scene) and has a clearance:
    /// surfaces within it do not block its rays.
    bool occluded(const Vec3& p, const Vec3& ng_p, float reach_p, const Vec3& q, float clearance = 0) const;
    /// The clearance of the lens.
    float camera_clearance() const { return camera_clearance_; }

  private:
    Scene() = default;
    Scene(const Scene&) = default;
    void collect_emitters(std::vector<Emitter>* emitters, LightMaps* maps);
    /// Largest coordinate magnitude of everything in the scene.
    float largest_reach(const Bounds3& bounds) const;
    Status find_contacts(std::vector<Emitter>* emitters, float largest);
    bool find_surface(const Vec3& o, const Vec3& d, float clearance, RawHit* hit) const;
    void surface_point(const Vec3& o, const Vec3& d, const RawHit& hit, SurfacePoint* out) const;
    /// The shading frame of a material with a displacement or normal map. If the material is a mix, the point's
    /// material becomes the one that is chosen.
    void tilt(const RawHit& hit, SurfacePoint* point) const;
    void summarise();
    void triangle_point(const TriangleMesh& mesh, const RawHit& hit, SurfacePoint* out) const;
    static float opacity(const void* user, const Accel::OpacityQuery& query);

    std::shared_ptr<SceneDescription> description_;
    TextureTables tables_;
    std::shared_ptr<Accel> accel_;
    std::vector<int32_t> mesh_first_emitter_;  // per world mesh, kNone where it does not emit
    std::vector<int32_t> sphere_emitter_;      // per world sphere
    std::vector<Mat4> instance_inverse_;
    std::vector<std::string> light_sources_;  // where each light group came from
    std::vector<uint8_t> tilts_;              // per material: whether tilt() has to handle it; empty if it never has to
    EmitterSet emitters_;
    Camera camera_;
    float camera_clearance_ = 0;
    ContactFinder::Covered covered_;  ///< Surfaces that area lights in their plane cover.
    /// Largest coordinate magnitude in the whole scene, at most 1/4: in a scene of ordinary size small primitives keep the
    /// offsets that rays from afar need, and only in a scene that is tiny as a whole do the offsets shrink with it.
    float least_reach_ = 0.25f;
    FrameLayout frame_;
    SceneSummary summary_;
};

}  // namespace lightloom
