// Partials of units that only splat: no camera sample in any pixel, light paths all the same. Everything between the unit and the
// image takes them, on the wire as well.

#include <gtest/gtest.h>

#include "common/film/accumulation.h"
#include "common/film/partial_exr.h"

namespace lightloom {
namespace {

const FrameLayout kFrame{12, 10, {2, 1, 10, 9}};

/// `splats` neighbouring pixels from the first one on, with `value` in the middle channel.
Partial splats_only(const Rect& tile, uint32_t splats, double value, uint64_t light_paths = 16) {
    Partial partial;
    partial.tile = tile;
    partial.samples_per_pixel = 0;
    partial.camera.assign(size_t(3 * tile.area()), 0.0);
    partial.light_paths = light_paths;
    for (uint32_t i = 0; i < splats; ++i) partial.splats.push_back({i, {1, value, 3}});
    partial.counters.light_paths = light_paths;
    return partial;
}

/// Without splats, with few (sparse) and with one in every pixel (dense). Sums that are all zero do not travel with splats.
TEST(SplatsOnly, TravelBitForBit) {
    for (const uint32_t splats : {0u, 3u, uint32_t(kFrame.crop.area())}) {
        const Partial partial = splats_only({2, 1, 6, 9}, splats, 0.1);
        ASSERT_TRUE(check_partial(partial, kFrame).ok());
        const Result<EncodedPartial> encoded = encode_partial(partial, kFrame);
        ASSERT_TRUE(encoded.ok()) << encoded.status().message();
        EXPECT_EQ(encoded->descriptor.samples_per_pixel, 0u);
        const PartialExpectation expected{kFrame, partial.tile, 0, partial.light_paths};
        EXPECT_EQ(encoded->payload.size(), partial_payload_size(expected, splats));
        EXPECT_EQ(encoded->payload.find("camera") == std::string::npos, splats > 0);
        const Result<Partial> back = decode_partial(expected, encoded->descriptor, encoded->payload);
        ASSERT_TRUE(back.ok()) << back.status().message();
        EXPECT_EQ(back->samples_per_pixel, 0u);
        EXPECT_EQ(back->camera, partial.camera);
        EXPECT_EQ(back->light_paths, partial.light_paths);
        EXPECT_EQ(back->splats, partial.splats);
        EXPECT_EQ(encode_partial(*back, kFrame)->payload, encoded->payload);
        // Who expects camera samples takes it for another unit's.
        PartialExpectation sampled = expected;
        sampled.samples_per_pixel = 4;
        EXPECT_EQ(decode_partial(sampled, encoded->descriptor, encoded->payload).status().code(), StatusCode::kDataLoss);
    }
}

/// Sums of the camera are there, though zero: a partial without them does not fit its tile.
TEST(SplatsOnly, NeedTheirCameraSums) {
    Partial partial = splats_only(kFrame.crop, 2, 0.5);
    partial.camera.clear();
    EXPECT_EQ(check_partial(partial, kFrame).status().code(), StatusCode::kDataLoss);
    EXPECT_EQ(encode_partial(partial, kFrame).status().code(), StatusCode::kDataLoss);
}

TEST(SplatsOnly, FoldIntoAnImageAndItsVariance) {
    const Rect tiles[] = {{2, 1, 6, 9}, {6, 1, 10, 9}};
    Accumulation total(kFrame);
    // Groups of 1 and 3 iterations, in whose first pixel the middle channel is 2 / 32 and 8 / 96 per light path.
    for (const uint32_t iterations : {1u, 3u}) {
        GroupSum group(kFrame);
        for (const Rect& tile : tiles)
            ASSERT_TRUE(group.add(splats_only(tile, 4, iterations == 1 ? 1 : 4, 16 * uint64_t(iterations))).ok());
        ASSERT_TRUE(total.fold(group, iterations).ok());
    }
    EXPECT_EQ(total.iterations(), 4u);
    const RgbImage image = total.develop();
    EXPECT_FLOAT_EQ(image.pixels[1], 10.0f / 128);
    EXPECT_EQ(image.pixels[3 * 4 + 1], 0.0f);
    // sum n (X - mean)^2 / ((G - 1) sum n)
    const double mean = 10.0 / 128, a = 2.0 / 32 - mean, b = 8.0 / 96 - mean;
    EXPECT_FLOAT_EQ(total.variance().pixels[1], float((a * a + 3 * b * b) / 4));
}

TEST(SplatsOnly, GroupsAreEitherOfOneKindOrTheOther) {
    GroupSum mixed(kFrame);
    ASSERT_TRUE(mixed.add(splats_only({2, 1, 6, 9}, 1, 1)).ok());
    Partial sampled = splats_only({6, 1, 10, 9}, 1, 1);
    sampled.samples_per_pixel = 2;
    ASSERT_TRUE(mixed.add(sampled).ok());
    Accumulation total(kFrame);
    EXPECT_EQ(total.fold(mixed, 2).code(), StatusCode::kFailedPrecondition);
    GroupSum nothing(kFrame);
    ASSERT_TRUE(nothing.add(splats_only(kFrame.crop, 0, 0, 0)).ok());
    EXPECT_EQ(total.fold(nothing, 2).code(), StatusCode::kFailedPrecondition) << "no camera sample and no light path";
    EXPECT_EQ(total.group_count(), 0u);
}

}  // namespace
}  // namespace lightloom
