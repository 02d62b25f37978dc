#include <gtest/gtest.h>
#include <chrono>
#include <cstdio>
#include "common/transport/renderer.h"
#include "tests/support/small_scenes.h"

namespace lightloom {
namespace {

TEST(Quick, MeansAgree) {
    auto b = testing::cornell_builder(64);
    b.description().max_depth = 5;
    auto scene = b.build();
    for (const char* algorithm : {"path", "light", "bdpt"}) {
        RenderSettings settings;
        settings.algorithm = algorithm;
        settings.max_depth = 5;
        auto r = Renderer::create(scene, settings);
        ASSERT_TRUE(r.ok());
        const int n = 64;
        const auto t0 = std::chrono::steady_clock::now();
        auto p = (*r)->render({0, uint32_t(n), 0, {0, 0, 64, 64}, 0, uint64_t(n) * 4096}, {});
        const double dt = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
        ASSERT_TRUE(p.ok());
        double sum[3] = {};
        for (size_t i = 0; i < p->camera.size(); ++i) sum[i % 3] += p->camera[i] / n / 4096;
        for (const auto& s : p->splats) for (int c = 0; c < 3; ++c) sum[c] += s.rgb[c] / p->light_paths / 4096;
        std::printf("%s %.5f %.5f %.5f  %.0f samples/s %.2f Mrays/s dropped %lu\n", algorithm, sum[0], sum[1], sum[2], n * 4096 / dt, p->counters.rays/dt*1e-6, p->dropped_count);
    }
}

}  // namespace
}  // namespace lightloom
