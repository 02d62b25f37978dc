#pragma once
// Lights whose strength is given by an image: over the surface of an area light, or over the directions of a light at a
// point.

#include "common/core/transform.h"
#include "common/core/vec.h"
#include "common/scene/image.h"
#include "common/scene/sampling.h"

namespace lightloom {

struct Emitter;

/// The image of an area light on one triangle or sphere, looked up by the shape's (u, v): bilinear, clamped at its border, row 0 at
/// v = 1, as pbrt-v4 does.
class SurfaceMap {
  public:
    /// The map of a triangle with these (u, v) at its corners. `image` must outlive this object; `image_mean` is its
    /// mean().
    SurfaceMap(const Image& image, const Rgb& image_mean, const Vec2 uv[3]);
    /// The map of a sphere with this Sphere::orientation.
    SurfaceMap(const Image& image, const Rgb& image_mean, const Frame& orientation);

    /// Factor of the radiance of `e`, the emitter of this map, at a point on it. It depends on the point only,
    /// whichever technique found it.
    Rgb at(const Emitter& e, const Vec3& position) const;
    /// Mean over the primitive's area, for the light's power, by a midpoint rule of at most 1024 points that are half a
    /// texel apart where these suffice; and at least a hundredth of the image's mean, so that a light is chosen even if
    /// the rule misses its bright spot.
    const Rgb& mean() const { return mean_; }

  private:
    Rgb lookup(Vec2 uv) const;
    void raise_mean(const Rgb& image_mean);

    const Image* image_;
    Vec2 uv_[3];
    Frame orientation_{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    Rgb mean_;
};

/// Intensity by direction: an image that a pinhole projects, or one that is wrapped around the light. It is constant on every texel
/// (point lookup, as in pbrt-v4), so that texels can be drawn exactly in proportion to their flux.
class DirectionMap {
  public:
    /// Seen from the light along +z with +y up and +x to the right, the image fills [-half_width, half_width] x [-half_height,
    /// half_height] at distance 1, row 0 at the top. `image` must outlive this object; of `light_to_world` the rotation is used.
    static DirectionMap projection(const Image& image, const Mat4& light_to_world, float half_width, float half_height);
    /// An equal-area octahedral map about the light's +y, as pbrt-v4's goniometric lights have it: grey, the mean of the channels.
    static DirectionMap goniometric(const Image& image, const Mat4& light_to_world);

    /// Factor of the light's intensity along the unit vector `w`, away from the light.
    Rgb intensity(const Vec3& w) const;
    /// Density of sample() at `w`, 1/sr.
    float pdf_solid_angle(const Vec3& w) const;
    /// Samples a direction; `pick` in [0, 1) adds 24 bits to u.x for the choice of the texel.
    Vec3 sample(float pick, Vec2 u) const;
    /// Integral of intensity() over all directions, sr.
    const Rgb& integral() const { return integral_; }
    /// Mean of intensity() over the directions that the image covers.
    Rgb mean() const { return integral_ / covered_; }

  private:
    DirectionMap(const Image& image, const Mat4& light_to_world);
    void set_weights(const std::vector<double>& solid_angles);
    Rgb texel(size_t i) const;
    /// Finds the texel that `w` falls into; its probability times `*density` is the density of sample() at `w`. False
    /// outside of the image.
    bool find(const Vec3& w, size_t* texel, float* density) const;

    const Image* image_;
    Mat4 to_light_, to_world_;  // rotations
    bool planar_ = false;
    float half_width_ = 0, half_height_ = 0;
    AliasTable texels_;
    Rgb integral_;
    float covered_ = 0;  // sr
};

}  // namespace lightloom
