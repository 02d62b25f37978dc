// The camera: what sample_ray() makes, project() finds again, with the density of one pixel; for a
// pinhole, a thin lens, a mirrored camera, a screen window, another aspect ratio, parallel rays, and all directions.

#include "common/scene/camera.h"

#include <gtest/gtest.h>

#include "common/core/math.h"
#include "common/core/rng.h"
#include "tests/support/statistics.h"

namespace lightloom {
namespace {

struct Case {
    const char* name;
    CameraDescription camera;
};

std::vector<Case> cases() {
    CameraDescription base;
    base.camera_to_world = *inverse(*look_at({1, 2, 3}, {0, 0.5f, -1}, {0.1f, 1, 0}));
    base.fov_degrees = 65;
    CameraDescription lens = base, mirrored = base, window = base, aspect = lens, scaled = lens, square = base, panorama = mirrored;
    lens.lens_radius = aspect.lens_radius = scaled.lens_radius = 0.2f;
    lens.focal_distance = aspect.focal_distance = scaled.focal_distance = 3;
    mirrored.camera_to_world = base.camera_to_world * scaling(-1, 1, 1);
    window.has_screen_window = true;
    const float rectangle[4] = {-0.3f, 1.1f, -0.2f, 0.5f};
    std::copy(rectangle, rectangle + 4, window.screen_window);
    aspect.frame_aspect_ratio = 2.5f;
    scaled.camera_to_world = base.camera_to_world * scaling(2, 2, 2);
    CameraDescription parallel = window, parallel_scaled = base;
    parallel.kind = parallel_scaled.kind = CameraKind::kOrthographic;
    parallel_scaled.camera_to_world = scaled.camera_to_world * scaling(-1, 1, 1);
    square.kind = CameraKind::kEqualArea;
    panorama.camera_to_world = mirrored.camera_to_world;
    panorama.kind = CameraKind::kEquirectangular;
    return {{"pinhole", base},           {"thin lens", lens},
            {"mirrored", mirrored},      {"screen window", window},
            {"aspect ratio", aspect},    {"scaled", scaled},
            {"parallel rays", parallel}, {"parallel rays, scaled and mirrored", parallel_scaled},
            {"equal-area", square},      {"equirectangular", panorama}};
}

constexpr int kWidth = 40, kHeight = 24;

bool sees_all_directions(const Case& c) {
    return c.camera.kind == CameraKind::kEqualArea || c.camera.kind == CameraKind::kEquirectangular;
}

TEST(Camera, ProjectFindsWhatSampleRayMade) {
    for (const Case& c : cases()) {
        const Camera camera = *Camera::create(c.camera, kWidth, kHeight);
        Rng rng({1, Stage::kTraining, 0, 0});
        for (int i = 0; i < 20000; ++i) {
            // Away from the border, where rounding may decide either way.
            const Vec2 u = rng.uniform2(), film{0.01f + u.x * (kWidth - 0.02f), 0.01f + u.y * (kHeight - 0.02f)},
                       lens = rng.uniform2();
            const Camera::CameraRay ray = camera.sample_ray(film, lens);
            if (!camera.has_parallel_rays()) {
                EXPECT_EQ(length(ray.origin - camera.sample_lens(lens)), 0) << c.name;
            }
            Vec2 found;
            float pdf = 0;
            ASSERT_TRUE(camera.project(ray.origin, ray.direction, &found, &pdf)) << c.name;
            EXPECT_NEAR(found.x, film.x, 1e-3f) << c.name;
            EXPECT_NEAR(found.y, film.y, 1e-3f) << c.name;
            EXPECT_NEAR(pdf / ray.pdf, 1, 1e-4f) << c.name;
            // And so is a point on the ray, at any distance.
            const float distance = 0.5f + 3 * u.x;
            Vec3 start = camera.sample_lens(lens);
            Camera::Sight sight;
            ASSERT_TRUE(camera.see(ray.origin + ray.direction * distance, &start, &sight)) << c.name;
            EXPECT_NEAR(length(start - ray.origin), 0, 1e-5f) << c.name;
            EXPECT_NEAR(length(sight.direction - ray.direction), 0, 1e-5f) << c.name;
            EXPECT_NEAR(sight.film.x, film.x, 2e-3f) << c.name;
            EXPECT_NEAR(sight.film.y, film.y, 2e-3f) << c.name;
            const float across = camera.has_parallel_rays() ? 1 : distance * distance;
            EXPECT_NEAR(sight.pdf / sight.distance2 / (ray.pdf / across), 1, 1e-3f) << c.name;
        }
    }
}

TEST(Camera, DirectionsBehindOrBesideTheFrameAreNotSeen) {
    for (const Case& c : cases()) {
        if (sees_all_directions(c)) continue;
        const Camera camera = *Camera::create(c.camera, kWidth, kHeight);
        Vec2 film;
        float pdf = 0;
        const Vec3 lens = camera.sample_lens({0.5f, 0.5f});
        EXPECT_FALSE(camera.project(lens, -camera.forward(), &film, &pdf)) << c.name;
        Vec3 start = lens;
        Camera::Sight sight;
        EXPECT_FALSE(camera.see(lens - camera.forward(), &start, &sight)) << c.name;
        for (const Vec2 outside : {Vec2{-1, 5}, Vec2{kWidth + 1, 5}, Vec2{5, -1}, Vec2{5, kHeight + 1}}) {
            const Camera::CameraRay ray = camera.sample_ray(outside, {0.5f, 0.5f});
            EXPECT_FALSE(camera.project(ray.origin, ray.direction, &film, &pdf)) << c.name;
        }
    }
}

/// The density is that of one pixel: uniform directions, weighted by it, find each pixel with
/// probability one.
TEST(Camera, DensityOfAPixelIntegratesToOne) {
    testing::TestFamily family;
    for (const Case& c : cases()) {
        const Camera camera = *Camera::create(c.camera, kWidth, kHeight);
        if (camera.has_parallel_rays()) {  // one over the area between its neighbours' rays
            const auto at = [&](float x, float y) { return camera.sample_ray({x, y}, {}).origin; };
            const double area = length(cross(at(21, 12) - at(20, 12), at(20, 13) - at(20, 12)));
            EXPECT_NEAR(double(camera.sample_ray({20, 12}, {}).pdf) * area, 1, 1e-4) << c.name;
            continue;
        }
        for (const Vec2 lens : {Vec2{0.5f, 0.5f}, Vec2{0.9f, 0.2f}}) {
            // Uniform directions in a cone around the pixel.
            for (const Vec2 pixel : {Vec2{0, 0}, Vec2{20, 12}, Vec2{39, 3}}) {
                const Camera::CameraRay axis = camera.sample_ray({pixel.x + 0.5f, pixel.y + 0.5f}, lens);
                double widest = 1;
                for (const Vec2 corner : {Vec2{0, 0}, Vec2{1, 0}, Vec2{0, 1}, Vec2{1, 1}})
                    widest = std::min(
                        widest,
                        double(dot(axis.direction, camera.sample_ray({pixel.x + corner.x, pixel.y + corner.y}, lens).direction)));
                const double height = 1.5 * (1 - widest), cone = 2 * kPiD * height;
                Rng rng({2, Stage::kTraining, uint64_t(pixel.x), uint64_t(pixel.y)});
                std::vector<double> groups(20, 0);
                const int per_group = 4000;
                for (double& group : groups)
                    for (int i = 0; i < per_group; ++i) {
                        const Vec2 u = rng.uniform2();
                        const double z = 1 - u.x * height, r = std::sqrt(1 - z * z), phi = 2 * kPiD * u.y;
                        const Vec3 d =
                            Frame(axis.direction).to_world({float(r * std::cos(phi)), float(r * std::sin(phi)), float(z)});
                        Vec2 film;
                        float pdf = 0;
                        if (!camera.project(axis.origin, d, &film, &pdf)) continue;
                        if (std::floor(film.x) == pixel.x && std::floor(film.y) == pixel.y) group += double(pdf) * cone / per_group;
                    }
                family.add(testing::one_sample_p_value(testing::Sample(groups), 1), c.name);
            }
        }
    }
    family.check();
}

/// Film positions of uniform samples of a pixel: uniform after a round trip through directions.
TEST(Camera, SamplesCoverThePixelUniformly) {
    testing::TestFamily family;
    for (const Case& c : cases()) {
        const Camera camera = *Camera::create(c.camera, kWidth, kHeight);
        const int bins = 8, n = 40000;
        std::vector<double> observed(bins * bins, 0), expected(bins * bins, double(n) / (bins * bins));
        Rng rng({3, Stage::kTraining, 0, 0});
        int lost = 0;
        for (int i = 0; i < n; ++i) {
            const Vec2 u = rng.uniform2();
            const Camera::CameraRay ray = camera.sample_ray({17 + u.x, 9 + u.y}, rng.uniform2());
            Vec2 film;
            float pdf = 0;
            ASSERT_TRUE(camera.project(ray.origin, ray.direction, &film, &pdf));
            const int x = int(std::floor((film.x - 17) * bins)), y = int(std::floor((film.y - 9) * bins));
            if (x < 0 || x >= bins || y < 0 || y >= bins)
                ++lost;
            else
                ++observed[size_t(y * bins + x)];
        }
        EXPECT_LT(lost, n / 1000) << c.name;  // rounding at the border
        family.add(testing::chi_square_test(observed, expected).p_value, c.name);
    }
    family.check();
}

/// Every sample of the lens lies on its disc, uniformly: equal counts in rings and sectors of equal
/// area.
TEST(Camera, LensIsUniform) {
    const Case lens = cases()[1];
    const Camera camera = *Camera::create(lens.camera, kWidth, kHeight);
    const Vec3 centre = camera.sample_lens({0.5f, 0.5f});
    const Frame frame(camera.forward());
    const int rings = 6, sectors = 12, n = 60000;
    std::vector<double> observed(rings * sectors, 0), expected(rings * sectors, double(n) / (rings * sectors));
    Rng rng({4, Stage::kTraining, 0, 0});
    for (int i = 0; i < n; ++i) {
        const Vec3 p = frame.to_local(camera.sample_lens(rng.uniform2()) - centre);
        EXPECT_NEAR(p.z, 0, 1e-6f);
        const double r2 = double(p.x * p.x + p.y * p.y) / (0.2 * 0.2), phi = std::atan2(p.y, p.x) / (2 * kPiD) + 0.5;
        ASSERT_LE(r2, 1.00001);
        ++observed[size_t(std::min(rings - 1, int(r2 * rings)) * sectors + std::min(sectors - 1, int(phi * sectors)))];
    }
    EXPECT_GT(testing::chi_square_test(observed, expected).p_value, 0.001);
}

/// As pbrt-v4's spherical cameras see: +y up, and of the panorama +x at the left border, +z a quarter of the way to the right.
TEST(Camera, AllDirectionsHaveTheirPlaces) {
    CameraDescription description;
    description.kind = CameraKind::kEquirectangular;
    const Camera panorama = *Camera::create(description, 64, 32);
    const auto near = [](const Vec3& a, const Vec3& b) { return length(a - b) < 1e-5f; };
    EXPECT_TRUE(near(panorama.sample_ray({0, 16}, {}).direction, {1, 0, 0}));
    EXPECT_TRUE(near(panorama.sample_ray({16, 16}, {}).direction, {0, 0, 1}));
    EXPECT_TRUE(near(panorama.sample_ray({32, 16}, {}).direction, {-1, 0, 0}));
    EXPECT_TRUE(near(panorama.sample_ray({5, 0}, {}).direction, {0, 1, 0}));
    description.kind = CameraKind::kEqualArea;
    const Camera square = *Camera::create(description, 64, 64);
    EXPECT_TRUE(near(square.sample_ray({32, 32}, {}).direction, {0, 1, 0}));
    EXPECT_TRUE(near(square.sample_ray({64, 32}, {}).direction, {1, 0, 0}));
    EXPECT_TRUE(near(square.sample_ray({32, 64}, {}).direction, {0, 0, 1}));
    EXPECT_TRUE(near(square.sample_ray({0, 0}, {}).direction, {0, -1, 0}));
}

TEST(Camera, ImpossibleCamerasAreRefused) {
    CameraDescription camera;
    EXPECT_TRUE(Camera::create(camera, 4, 4).ok());
    EXPECT_FALSE(Camera::create(camera, 0, 4).ok());
    camera.fov_degrees = 180;
    EXPECT_FALSE(Camera::create(camera, 4, 4).ok());
    camera.fov_degrees = 60;
    camera.camera_to_world = scaling(1, 2, 1);
    EXPECT_FALSE(Camera::create(camera, 4, 4).ok());
    camera.camera_to_world = {};
    camera.lens_radius = -1;
    EXPECT_FALSE(Camera::create(camera, 4, 4).ok());
    camera.lens_radius = 0.1f;
    camera.kind = CameraKind::kOrthographic;
    EXPECT_FALSE(Camera::create(camera, 4, 4).ok());
}

}  // namespace
}  // namespace lightloom
