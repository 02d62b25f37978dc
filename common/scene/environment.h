#pragma once
// All infinite lights of a scene as one emitter: radiance by direction, importance sampling, and its density. Summing them
// first makes the density of a direction the sum over the lights, as every technique's weight needs.

#include <vector>

#include "common/core/transform.h"
#include "common/scene/description.h"
#include "common/scene/sampling.h"

namespace lightloom {

class Environment {
  public:
    Environment() = default;
    /// `images` must outlive this object.
    Environment(const std::vector<InfiniteLight>& lights, const std::vector<Image>& images);

    bool empty() const { return parts_.empty(); }
    /// Radiance arriving from direction `d` (unit, pointing away from the scene towards the environment).
    Rgb radiance(const Vec3& d) const;
    /// Density of sample() at `d`, solid angle, 1/sr.
    float pdf_solid_angle(const Vec3& d) const;
    /// Samples a direction towards the environment; `pick` selects among the lights, `u` the direction.
    Vec3 sample(float pick, Vec2 u) const;
    /// Integral of scalar_of(radiance) over the sphere, W / m^2.
    double integrated_radiance() const { return total_; }

  private:
    struct Part {
        Mat4 to_light, to_world;  // rotations
        Rgb scale;
        const Image* image = nullptr;  // null: constant
        AliasTable texels;
        float pmf = 0;
    };
    std::vector<Part> parts_;
    AliasTable pick_;
    double total_ = 0;
};

}  // namespace lightloom
