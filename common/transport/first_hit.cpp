#include "common/transport/first_hit.h"

#include "common/core/fork_join.h"
#include "common/path/camera_walk.h"

namespace lightloom {

std::vector<ImageLayer> first_hit_layers(const Scene& scene, uint64_t seed, int samples) {
    const Rect crop = scene.frame().crop;
    const size_t pixels = size_t(crop.area());
    std::vector<ImageLayer> layers{{"albedo", "RGB", std::vector<float>(3 * pixels)},
                                   {"normal", "XYZ", std::vector<float>(3 * pixels)},
                                   {"depth", "Z", std::vector<float>(pixels)}};
    fork_join(pixels, [&](size_t first, size_t last) {
        for (size_t pixel = first; pixel < last; ++pixel) {
            const int row = int(pixel / size_t(crop.width())), column = int(pixel % size_t(crop.width()));
            Rgb albedo;
            Vec3 normal;
            float depth = 0;
            int hits = 0;
            for (int i = 0; i < samples; ++i) {
                const CameraSampler sampler(seed, uint64_t(i), pixel);
                const Camera::CameraRay ray = sampler.ray(scene.camera(), crop.x0 + column, crop.y0 + row);
                SurfacePoint point;
                if (!scene.intersect(ray.origin, ray.direction, &point, scene.camera_clearance())) continue;
                albedo += scene.bsdf_at(point).albedo();
                normal += face_forward(point.shading.n, -ray.direction);
                depth += length(point.p - ray.origin);
                ++hits;
            }
            const float scale = 1.0f / float(samples);
            for (int c = 0; c < 3; ++c) {
                layers[0].pixels[3 * pixel + size_t(c)] = albedo[c] * scale;
                layers[1].pixels[3 * pixel + size_t(c)] = normal[c] * scale;
            }
            // Rays that hit nothing do not count: as zeros, at a silhouette, they would pull the depth in front of the
            // surface.
            layers[2].pixels[pixel] = hits > 0 ? depth / float(hits) : 0;
        }
    });
    return layers;
}

}  // namespace lightloom
