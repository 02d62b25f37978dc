// What photons need of memory is known before they are traced, and a machine that has less gets one clear line.

#include <gtest/gtest.h>

#include "common/transport/photon_memory.h"
#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

TEST(PhotonMemory, IsAboutWhatWasExpected) {
    for (const auto& scene : {testing::diffuse_box(), testing::glossy()}) {
        const RenderSettings settings = testing::settings_of("vcm", {{"light-paths", "64"}});
        const Tables tables;
        const RendererRequest request{scene, settings, tables, nullptr, nullptr};
        const PhotonMemory before = most_photon_memory();
        const PhotonMemory expected = expected_photon_memory(request, request.light_paths_per_iteration());
        const auto renderer = Renderer::create(scene, settings);
        ASSERT_TRUE(renderer.ok()) << renderer.status().message();
        ASSERT_TRUE((*renderer)->render(testing::whole_frame(*scene, settings.algorithm, 1), {}).ok());
        const PhotonMemory most = most_photon_memory();
        EXPECT_GE(most.total(), before.total());
        // Pages are whole, and the list of prefixes is gone by then.
        EXPECT_GT(double(expected.total()), 0.8 * double(most.total()));
        EXPECT_LT(double(expected.total()), 2 * double(most.total()));
        EXPECT_GT(most.map, 0u);
    }
}

TEST(PhotonMemory, TooLittleIsOneClearLine) {
    const auto scene = testing::diffuse_box();
    const RenderSettings settings = testing::settings_of("vcm");
    const Tables tables;
    const RendererRequest request{scene, settings, tables, nullptr, nullptr};
    EXPECT_TRUE(check_photon_memory(request, 1000, uint64_t(2) << 30).ok());
    const Status refused = check_photon_memory(request, 10'000'000, uint64_t(2) << 30);
    EXPECT_EQ(refused.code(), StatusCode::kResourceExhausted);
    const std::string text(refused.message());
    EXPECT_TRUE(text.starts_with("the 10000000 light sub-paths of an iteration need about ")) << text;
    EXPECT_TRUE(text.ends_with(" GB of memory as photons; this machine has 2.1 GB: lower light-paths, cache or the resolution"))
        << text;
}

}  // namespace
}  // namespace lightloom
