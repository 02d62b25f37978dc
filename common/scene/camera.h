#pragma once
// Perspective camera with an optional thin lens. Measure convention used everywhere: the position on the lens has density 1
// (every technique samples it the same way), and the direction has the density of the primary ray of ONE pixel (image-plane
// density 1 per pixel area). Then a camera sample starts with throughput 1, and the contribution of a light sub-path to a
// pixel is its throughput times the area density that camera sampling would have had at its last vertex.

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

class Camera {
  public:
    Camera() = default;
    static Result<Camera> create(const PerspectiveCamera& camera, int width, int height);

    struct CameraRay {
        Vec3 origin, direction;     ///< World; unit direction.
        float pdf_solid_angle = 0;  ///< Of the direction, for one pixel, 1/sr.
    };
    /// `film` in pixels (x right, y down, continuous), `lens` uniform in [0, 1)^2.
    CameraRay sample_ray(Vec2 film, Vec2 lens) const;

    /// False for a pinhole, which has no use for `lens`.
    bool has_lens() const { return lens_radius_ > 0; }

    /// A point on the lens, world.
    Vec3 sample_lens(Vec2 lens) const;

    /// What the camera sees of a world direction leaving the lens point: the film position and the density of one pixel.
    /// False when the direction falls outside of the frame (but not necessarily outside of the crop).
    bool project(const Vec3& lens_point, const Vec3& direction, Vec2* film, float* pdf_solid_angle) const;

    /// Centre of the lens, world.
    Vec3 position() const { return position_; }
    /// Unit viewing direction, world.
    Vec3 forward() const { return forward_; }

  private:
    Vec3 right_, up_, forward_, position_;  // unit, orthogonal
    int width_ = 0, height_ = 0;
    float x0_ = 0, y1_ = 0;            // film plane at distance 1: left edge, top edge
    float pixel_w_ = 0, pixel_h_ = 0;  // size of a pixel there
    float inv_pixel_area_ = 0;
    float lens_radius_ = 0, focal_distance_ = 1;
};

}  // namespace lightloom
