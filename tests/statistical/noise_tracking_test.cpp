// The error that a rendering estimates from its own groups is its true error, within a factor of 1.5: on two scenes, against a long
// rendering by another algorithm. How well it does on more of them: tests/bench/README.md.

#include "tests/support/noise_tracking.h"

#include <gtest/gtest.h>

namespace lightloom {
namespace {

/// A closed room whose every pixel is smooth, and one that is lit by rare bright paths.
TEST(NoiseTracking, WithinAFactorOfOneAndAHalf) {
    struct Case {
        const char* scene;
        int width, height;
        uint64_t iterations;
        std::vector<std::string> algorithms;
    };
    for (const Case& c : {Case{"cornell", 32, 32, 64, {"path", "bdpt", "light", "lvcbpt:training-paths=2000"}},
                          Case{"glossy-lamps", 64, 36, 64, {"path", "bdpt", "lvcbpt:training-paths=2000"}}}) {
        const auto scene =
            testing::load_tracked(std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/" + c.scene + ".pbrt", c.width, c.height);
        ASSERT_TRUE(scene.ok()) << scene.status().message();
        const auto reference = testing::make_tracked_reference(*scene, "bdpt:rr-start=5", 1024);
        ASSERT_TRUE(reference.ok()) << reference.status().message();
        for (const std::string& algorithm : c.algorithms) {
            const auto track = testing::track_noise(*scene, *reference, algorithm, 7, c.iterations, 2);
            ASSERT_TRUE(track.ok()) << track.status().message();
            ASSERT_EQ(track->size(), 2u);
            for (const testing::TrackedPoint& point : *track) {
                SCOPED_TRACE(std::string(c.scene) + ", " + algorithm + ", " + std::to_string(point.iterations) + " iterations");
                EXPECT_GT(point.ratio(), 1 / 1.5);
                EXPECT_LT(point.ratio(), 1.5);
                EXPECT_GT(point.estimate.error, 0);
                EXPECT_LT(point.estimate.error, 0.4 * point.estimate.relmse);
            }
        }
    }
}

}  // namespace
}  // namespace lightloom
