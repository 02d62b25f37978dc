// The density map: what it says of photons whose density is known, its bytes, and what it refuses.

#include <gtest/gtest.h>

#include <cmath>

#include "common/core/rng.h"
#include "common/tables/density_part.h"
#include "common/tables/train_density.h"

namespace lightloom {
namespace {

/// Photons on the floor of a box of 2 m, four times as many on its left half.
std::vector<Vec3> floor_photons(size_t count) {
    Rng rng({3, Stage::kTraining, 0, 0});
    std::vector<Vec3> photons(count);
    for (size_t i = 0; i < count; ++i) {
        const float u = rng.uniform(), v = rng.uniform();
        photons[i] = {i % 5 == 0 ? u : u - 1, 0, 2 * v};
    }
    return photons;
}

TEST(DensityMap, TellsTheDensityOfPhotonsOnASurface) {
    constexpr size_t kCount = 100000;
    constexpr uint64_t kPaths = 50000;
    const DensityMap map(build_density_map(floor_photons(kCount), kPaths));
    ASSERT_TRUE(map.data().validate().ok());
    for (const bool left : {false, true}) {
        const double expected = (left ? 0.8 : 0.2) * kCount / (kPaths * 2.0);  // 2 m^2 each
        double mean = 0;
        int far_off = 0;
        for (int i = 0; i < 400; ++i) {
            const Vec3 p{(left ? -1.0f : 0.0f) + 0.05f + 0.045f * float(i % 20), 0, 0.05f + 0.095f * float(i / 20)};
            const double density = double(map.density(map.label(p)));
            mean += density / 400;
            far_off += !(std::fabs(density / expected - 1) < 1);
        }
        EXPECT_NEAR(mean / expected, 1, 0.15);
        EXPECT_LE(far_off, 4);
    }
    // Places beyond the photons belong to the nearest cells.
    EXPECT_GT(map.density(map.label({1e6f, -1e6f, 0})), 0);
}

TEST(DensityMap, FewPhotonsAndPhotonsInOnePlaceGiveAPositiveDensity) {
    EXPECT_FALSE(build_density_map({}, 10).learned());
    EXPECT_FALSE(build_density_map(std::vector<Vec3>(3), 0).learned());
    for (const size_t count : {size_t(1), size_t(5), size_t(1000)}) {
        const DensityData data = build_density_map(std::vector<Vec3>(count, Vec3{1, 2, 3}), 10);
        ASSERT_TRUE(data.learned());
        EXPECT_TRUE(data.validate().ok()) << count;
        const DensityMap map(data);
        EXPECT_GT(map.density(map.label({1, 2, 3})), 0);
    }
}

TEST(DensityMap, NeverHasMoreDensitiesThanLabels) {
    Rng rng({9, Stage::kTraining, 0, 0});
    std::vector<Vec3> photons(1500000);
    for (Vec3& p : photons) {
        const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
        p = {x, y, z};
    }
    const DensityData data = build_density_map(photons, 1000);
    EXPECT_TRUE(data.validate().ok());
    EXPECT_LE(data.densities.size(), DensityData::kMaxDensities);
    EXPECT_GT(data.densities.size(), size_t(5000));
}

TEST(DensityMap, BytesComeBackAndDamageIsRefused) {
    const DensityData data = build_density_map(floor_photons(5000), 1000);
    const std::string bytes = serialize(data);
    const auto again = parse_density(bytes);
    ASSERT_TRUE(again.ok());
    EXPECT_EQ(serialize(*again), bytes);
    EXPECT_EQ(again->nodes, data.nodes);
    const auto empty = parse_density(serialize(DensityData{}));
    ASSERT_TRUE(empty.ok());
    EXPECT_TRUE(empty->validate().ok());
    EXPECT_FALSE(empty->learned());
    std::string damaged = bytes;
    damaged[bytes.size() / 2] ^= 1;
    EXPECT_EQ(parse_density(damaged).status().code(), StatusCode::kDataLoss);
    EXPECT_EQ(parse_density(bytes.substr(0, bytes.size() - 3)).status().code(), StatusCode::kDataLoss);

    const auto refuses = [&](auto&& change) {
        DensityData wrong = data;
        change(wrong);
        EXPECT_EQ(wrong.validate().code(), StatusCode::kDataLoss);
    };
    refuses([](DensityData& d) { d.side = 0; });
    refuses([](DensityData& d) { d.side = NAN; });
    refuses([](DensityData& d) { d.corner.y = INFINITY; });
    refuses([](DensityData& d) { d.densities[1] = -1; });
    refuses([](DensityData& d) { d.densities.clear(); });
    refuses([](DensityData& d) { d.nodes[0] = 0; });
    refuses([](DensityData& d) { d.nodes[0] = uint32_t(d.nodes.size()) - 7; });
    refuses([](DensityData& d) { d.nodes.back() = DensityData::kLeaf | uint32_t(d.densities.size()); });
    refuses([](DensityData& d) { d.nodes.clear(); });
}

}  // namespace
}  // namespace lightloom
