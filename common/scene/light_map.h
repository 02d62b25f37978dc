#pragma once
// Lights whose strength an image gives: over the surface of an area light.

#include "common/core/vec.h"
#include "common/scene/image.h"

namespace lightloom {

struct Emitter;

/// The image of an area light on one triangle or sphere, looked up by the shape's (u, v): bilinear, clamped at its border, row 0 at
/// v = 1, as pbrt-v4 does.
class SurfaceMap {
  public:
    /// Of a triangle with these (u, v) at its corners. `image` must outlive this object; `image_mean` is its mean().
    SurfaceMap(const Image& image, const Rgb& image_mean, const Vec2 uv[3]);
    /// Of a sphere with this Sphere::orientation.
    SurfaceMap(const Image& image, const Rgb& image_mean, const Frame& orientation);

    /// What the radiance of `e`, which this map belongs to, is multiplied by at a point of it. A function of the point, whoever
    /// found it.
    Rgb at(const Emitter& e, const Vec3& position) const;
    /// Mean over the primitive's area, for the light's power, by a midpoint rule of at most 1024 points that are half a texel apart
    /// where these suffice; and, so that no part of a light is never chosen because a rule misses its bright spot, at least a
    /// hundredth of the image's mean.
    const Rgb& mean() const { return mean_; }

  private:
    Rgb lookup(Vec2 uv) const;
    void raise_mean(const Rgb& image_mean);

    const Image* image_;
    Vec2 uv_[3];
    Frame orientation_{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    Rgb mean_;
};

}  // namespace lightloom
