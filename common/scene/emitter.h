#pragma once
// Emitters: everything that light sub-paths start from and next event estimation connects to. One list; an emissive
// triangle is one emitter, all infinite lights together are one.
//
// Light sub-paths leave the emitters in proportion to power, or, where a table was learned for the scene, from the places
// and in the directions that matter. Next event estimation always chooses by power.
//
// The "native measure" of a point x_0 on an emitter: area (m^-2) for triangles and spheres, solid angle (sr^-1) of the
// direction towards it for the environment, counting measure for all others.

#include <cstdint>
#include <memory>
#include <vector>

#include "common/scene/description.h"
#include "common/scene/emission_table.h"
#include "common/scene/environment.h"
#include "common/scene/light_map.h"
#include "common/scene/sampling.h"

namespace lightloom {

enum class EmitterKind : uint8_t { kTriangle, kSphere, kPoint, kSpot, kDistant, kEnvironment, kProjection, kGoniometric };

struct Emitter {
    EmitterKind kind = EmitterKind::kTriangle;
    bool two_sided = false;
    float pmf = 0;        ///< Selection probability by power.
    int32_t map = kNone;  ///< Index of the map that multiplies `radiance`: SurfaceMap of area lights, DirectionMap of kProjection
                          ///< and kGoniometric, which have one.
    Rgb radiance;         ///< Radiance; intensity of lights at a point; irradiance for distant; unused for environment.
    Vec3 position;        ///< First corner, centre, or light position.
    Vec3 edge1, edge2;    ///< kTriangle.
    Vec3 normal;          ///< Unit; side that emits. Spot: axis. Distant: direction of travel.
    float radius = 0;     ///< kSphere; not negative. `inward` flips its emitting side.
    bool inward = false;
    float inv_area = 0;
    float total_height = 0, falloff_height = 0;  ///< kSpot; see SpotLight.
    float reach = 0;                             ///< Area lights: largest coordinate magnitude; see offset_origin().
    float clearance = 0;                         ///< Clearance of lights at a point: see Scene::intersect().
    bool hidden = false;                         ///< Area lights: no ray meets the surface, which only emits.
    int32_t light = 0;                           ///< Group for reports: the area-light shape or light source it came from.

    bool is_area() const { return kind == EmitterKind::kTriangle || kind == EmitterKind::kSphere; }
    bool is_infinite() const { return kind == EmitterKind::kDistant || kind == EmitterKind::kEnvironment; }
    bool has_direction_map() const { return kind == EmitterKind::kProjection || kind == EmitterKind::kGoniometric; }
    /// Whether x_0 is measured by counting: a point, or a single direction.
    bool is_discrete() const { return !is_area() && kind != EmitterKind::kEnvironment; }
    /// Whether a camera sub-path can find x_0 by itself. If not, there is no technique with s = 0.
    bool can_be_hit() const { return is_area() ? !hidden : kind == EmitterKind::kEnvironment; }
};

/// Start of a light sub-path: x_0 and the ray towards x_1.
struct EmissionSample {
    uint32_t emitter = 0;
    Vec3 position;            ///< x_0 for finite lights; ray origin outside the scene for infinite ones.
    Vec3 normal;              ///< Geometric normal at x_0 on the emitting side; for infinite lights the ray direction.
    Vec3 direction;           ///< Unit, along the light's travel.
    Rgb alpha;                ///< Emitted throughput: L |cos| / (pdf_position * pdf_direction).
    float pdf_position = 0;   ///< pmf included; native measure of x_0.
    float pdf_direction = 0;  ///< Solid angle for finite lights; area on the disc facing the scene, m^-2, for infinite ones.
};

/// Densities of the start of a light sub-path.
struct EmissionDensities {
    float position = 0;   ///< Of x_0; native measure, probability of the emitter included.
    float direction = 0;  ///< Given x_0: solid angle for finite lights; for infinite ones, whose x_0 is the direction, area
                          ///< across the ray, m^-2.
};

/// A point x_0 that was chosen from a reference point.
struct NextEventSample {
    uint32_t emitter = 0;
    Vec3 position;       ///< Point on a finite light; for infinite ones a point beyond the scene to test visibility to.
    Vec3 normal;         ///< At x_0, geometric; for infinite lights the direction of travel.
    Vec3 wi;             ///< Unit, from the reference point to the light.
    Rgb radiance;        ///< Emitted towards the reference point (intensity for lights at a point, irradiance for distant).
    float geometry = 0;  ///< Converts a solid-angle density at the reference point to the native measure: |cos| / d^2 for
                         ///< area lights, 1 / d^2 for lights at a point, 1 for infinite.
    float pdf = 0;       ///< Native measure, pmf included.
};

/// The maps that Emitter::map refers to.
struct LightMaps {
    std::vector<SurfaceMap> surfaces;
    std::vector<DirectionMap> directions;
};

class EmitterSet {
  public:
    EmitterSet() = default;
    /// `emitters` need no pmf yet; `centre` and `radius` are those of the sphere around the scene, for infinite lights.
    EmitterSet(std::vector<Emitter> emitters, Environment environment, Vec3 centre, float radius, LightMaps maps = {});

    /// Makes light sub-paths leave as the table says, which must be valid for these emitters; null: by power.
    void guide_emission(std::shared_ptr<const EmissionTable> table) { learned_ = std::move(table); }

    bool empty() const { return emitters_.empty(); }
    const std::vector<Emitter>& all() const { return emitters_; }
    const Emitter& operator[](uint32_t i) const { return emitters_[i]; }
    /// Index of the environment emitter, or kNone.
    int32_t environment_index() const { return environment_index_; }
    const Environment& environment() const { return *environment_; }
    float scene_radius() const { return scene_radius_; }
    /// A point outside of the scene, on a ray that has left it.
    Vec3 outside(const Vec3& origin, const Vec3& direction) const { return origin + direction * (2 * scene_radius_); }

    /// Scalar power of an emitter, W.
    double power(const Emitter& e) const;

    /// Samples the start of a light sub-path. False when there is no place. Nothing may leave it in the direction that was chosen,
    /// behind an area light for instance: then alpha is black, and x_0 is a point on a light all the same.
    bool sample_emission(double pick, Vec2 u_position, Vec2 u_direction, EmissionSample* out) const;
    /// Chooses x_0 from `reference`. False when the chosen point cannot light `reference` (wrong side, outside of a
    /// spot's cone...).
    bool sample_next_event(const Vec3& reference, double pick, Vec2 u, NextEventSample* out) const;

    /// Connects `reference` to a given x_0 of emitter `out->emitter`: `position` lies on a finite light;
    /// `normal_or_travel` is the normal of an area light or the direction of travel of an infinite one. Fills in the
    /// rest of `out` except pdf. False as above.
    bool connect_point(const Vec3& reference, const Vec3& position, const Vec3& normal_or_travel, NextEventSample* out) const;
    /// Radiance (or intensity, irradiance) leaving x_0 of emitter `e` along `w` (unit, away from the light); `position` is x_0, and
    /// `normal` the geometric normal there on the emitting side. The environment looks its map up in -w.
    Rgb emitted(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w) const;
    /// The part of emitted() that belongs to x_0 alone, F(1) of a light prefix: radiance of area lights and of the environment
    /// along `w`, intensity on a spot's axis, or the mean over an image.
    Rgb strength(const Emitter& e, const Vec3& position, const Vec3& w) const {
        if (e.kind == EmitterKind::kEnvironment) return environment_->radiance(-w);
        return e.has_direction_map() ? e.radiance * direction_map(e).mean() : radiance_at(e, position);
    }
    /// pL of x_0: density of sample_emission() for the point at `position`, native measure, probability of the emitter
    /// included. `w` as above (environment).
    float pdf_position(const Emitter& e, const Vec3& position, const Vec3& w) const;
    /// pdf_position() of x_0, and the density of the emission direction `w` given x_0; `normal` is the geometric one there. `x1` is
    /// a point that the light passes.
    EmissionDensities emission_densities(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w,
                                         const Vec3& x1) const;
    /// Density of sample_next_event() at x_0, native measure, pmf included. `position`, `normal` at x_0; `wi` from the
    /// reference point to it.
    float pdf_next_event(const Emitter& e, const Vec3& reference, const Vec3& position, const Vec3& normal, const Vec3& wi) const;

  private:
    /// The choice of x_0: the emitter, and the point on a finite light or the direction of an infinite one. `rest` receives a new
    /// uniform number.
    void sample_place(double pick, Vec2 u, EmissionSample* out, float* rest) const;
    /// The same on out->emitter.
    void sample_on_emitter(Vec2 u, EmissionSample* out, float rest) const;
    /// The choice of the direction of a finite light or of the ray of an infinite one.
    void sample_departure(float rest, Vec2 u, EmissionSample* out) const;
    /// Both choices with the learned table. `passed` receives a point that the light passes.
    void sample_learned(double pick, Vec2 u_position, Vec2 u_direction, EmissionSample* out, Vec3* passed) const;
    /// Puts the origin of an infinite light's ray through `point` before the scene.
    void start_before_scene(const Vec3& point, EmissionSample* out) const;
    // The densities by power alone, and those that were learned alone.
    float place_by_power(const Emitter& e, const Vec3& w) const { return e.pmf * place_on_emitter(e, w); }
    float place_on_emitter(const Emitter& e, const Vec3& w) const;
    float learned_place(const Emitter& e, const Vec3& position, const Vec3& w) const;
    float departure_by_power(const Emitter& e, const Vec3& normal, const Vec3& w) const;
    float learned_departure(const Emitter& e, const Vec3& position, const Vec3& normal, const Vec3& w, const Vec3& x1) const;

    const DirectionMap& direction_map(const Emitter& e) const { return maps_.directions[size_t(e.map)]; }
    Rgb radiance_at(const Emitter& e, const Vec3& position) const {
        return e.map == kNone ? e.radiance : e.radiance * maps_.surfaces[size_t(e.map)].at(e, position);
    }

    std::vector<Emitter> emitters_;
    AliasTable pick_;
    std::shared_ptr<const EmissionTable> learned_;
    std::shared_ptr<const Environment> environment_ = std::make_shared<const Environment>();  ///< Of all copies: it may be large.
    LightMaps maps_;
    int32_t environment_index_ = kNone;
    Vec3 centre_;
    float scene_radius_ = 1, disc_pdf_ = 0;
};

}  // namespace lightloom
