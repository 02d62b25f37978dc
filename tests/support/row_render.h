#pragma once
// Renders units of any row of the catalog, with small tables of its own if the algorithm learns.

#include <cstring>

#include "common/transport/parameters.h"
#include "tests/support/estimates.h"

namespace lightloom::testing {

using Parameters = std::map<std::string, std::string>;

inline RenderSettings row_settings(const AlgorithmInfo& row, uint64_t seed = 5, const Parameters& parameters = {}) {
    const std::string name(row.name);
    return settings_of(name, with_small_training(name, parameters), seed);
}

/// The whole frame as the row's plan would have it.
inline RenderUnit frame_of(const Scene& scene, const AlgorithmInfo& row, uint32_t iterations) {
    return whole_frame(scene, row_settings(row).algorithm, iterations);
}

/// Whether samples of the row share the light sub-paths of their unit.
inline bool has_cache(const AlgorithmInfo& row) { return row_settings(row).algorithm.has(kCache.name); }

/// The heuristics that the row's weights can have.
inline std::vector<std::string> heuristics_of(const AlgorithmInfo& row) {
    for (const ParameterInfo& p : row.parameters)
        if (p.name == kHeuristic.name) return {p.choices.begin(), p.choices.end()};
    return {};
}

inline Partial render(const std::shared_ptr<const Scene>& scene, const AlgorithmInfo& row, const RenderUnit& work,
                      uint64_t seed = 5, const Parameters& parameters = {}) {
    const auto renderer = create_with_tables(scene, row_settings(row, seed, parameters), {});
    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
    Result<Partial> partial = (*renderer)->render(work, {});
    if (!partial.ok()) throw std::runtime_error(partial.status().message());
    return std::move(partial).value();
}

/// Expects equal bits, counters included.
inline void expect_identical(const Partial& a, const Partial& b, const std::string& what) {
    ASSERT_EQ(a.camera.size(), b.camera.size()) << what;
    EXPECT_EQ(std::memcmp(a.camera.data(), b.camera.data(), a.camera.size() * sizeof(double)), 0) << what;
    ASSERT_EQ(a.splats.size(), b.splats.size()) << what;
    for (size_t i = 0; i < a.splats.size(); ++i) {
        EXPECT_EQ(a.splats[i].pixel, b.splats[i].pixel) << what;
        EXPECT_EQ(std::memcmp(a.splats[i].rgb.data(), b.splats[i].rgb.data(), sizeof(a.splats[i].rgb)), 0) << what;
    }
    EXPECT_EQ(a.counters.rays, b.counters.rays) << what;
    EXPECT_EQ(a.counters.vertices, b.counters.vertices) << what;
    EXPECT_EQ(a.counters.connections, b.counters.connections) << what;
    EXPECT_EQ(a.dropped, b.dropped) << what;
}

}  // namespace lightloom::testing
