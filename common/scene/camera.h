#pragma once
// Cameras: perspective with an optional thin lens, orthographic, and two that see in all directions. They share one
// measure convention: the position on the lens has density 1 (every technique samples it the same way), and the
// direction has the density of the primary ray of ONE pixel (image-plane density 1 per pixel area). Then a camera
// sample starts with throughput 1, and the contribution of a light sub-path to a pixel is its throughput times the area
// density that camera sampling would have had at its last vertex. For parallel rays it is the other way round: the
// direction has density 1, and the position has that of one pixel.

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

class Camera {
  public:
    Camera() = default;
    static Result<Camera> create(const CameraDescription& camera, int width, int height);

    struct CameraRay {
        Vec3 origin, direction;  ///< World; unit direction.
        float pdf = 0;           ///< For one pixel: of the direction, 1/sr, or of a parallel ray's position, 1/m^2.
    };
    /// `film` in pixels (x right, y down, continuous), `lens` uniform in [0, 1)^2.
    CameraRay sample_ray(Vec2 film, Vec2 lens) const;

    /// False for a pinhole, which ignores `lens`.
    bool has_lens() const { return lens_radius_ > 0; }
    bool has_parallel_rays() const { return kind_ == CameraKind::kOrthographic; }

    /// A point on the lens, world space. For parallel rays, see() determines where they start.
    Vec3 sample_lens(Vec2 lens) const;

    /// Projects a world direction that leaves the lens point (for a parallel ray: its start) to the film position, and
    /// gives the density for one pixel, CameraRay::pdf. False when the direction falls outside of the frame (but not
    /// necessarily outside of the crop).
    bool project(const Vec3& lens_point, const Vec3& direction, Vec2* film, float* pdf) const;

    /// A point as the camera sees it.
    struct Sight {
        Vec3 direction;  ///< Unit, from the camera to the point.
        Vec2 film;
        float pdf = 0;        ///< CameraRay::pdf.
        float distance2 = 0;  ///< pdf / distance2 is the density at the point, across the ray, 1/m^2. 1 for parallel rays.
    };
    /// Projects a point. `*lens` is a point of sample_lens() and is moved to the start of the ray if rays are parallel.
    /// False as for project().
    bool see(const Vec3& point, Vec3* lens, Sight* sight) const;

    /// The rectangle from which parallel rays start, world space: its upper left corner and the two edges from there,
    /// to the right and down.
    struct Window {
        Vec3 corner, right, down;
    };
    Window window() const {
        return {position_ + right_ * x0_ + up_ * y1_, right_ * (pixel_w_ * float(width_)), up_ * (-pixel_h_ * float(height_))};
    }

    /// Centre of the lens, world.
    Vec3 position() const { return position_; }
    /// Unit viewing direction, world.
    Vec3 forward() const { return forward_; }

  private:
    CameraRay sample_other_ray(Vec2 film) const;
    bool project_other(const Vec3& start, const Vec3& direction, Vec2* film, float* pdf) const;

    CameraKind kind_ = CameraKind::kPerspective;
    Vec3 right_, up_, forward_, position_;  // unit, orthogonal
    int width_ = 0, height_ = 0;
    float x0_ = 0, y1_ = 0;            // film plane at distance 1 (orthographic: at the camera, world): left edge, top edge
    float pixel_w_ = 0, pixel_h_ = 0;  // size of a pixel there
    float inv_pixel_area_ = 0;
    float lens_radius_ = 0, focal_distance_ = 1;
};

}  // namespace lightloom
