// The codec of partials.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "common/film/exr_io.h"
#include "common/film/exr_memory.h"
#include "tests/unit/film_testing.h"

namespace lightloom {
namespace {

using testing::expectation_of;
using testing::kFrame;
using testing::kInfinity;
using testing::kNan;
using testing::random_partial;
using testing::same;

// ---------------------------------------------------------------------------------------------------- partial codec

TEST(PartialExr, RoundTripsBitForBit) {
    const uint32_t area = uint32_t(kFrame.crop.area());
    for (const uint32_t splats : {0u, 1u, area / 4, area * 6 / 7 - 1, area * 6 / 7 + 1, area}) {
        for (const Rect& tile : {kFrame.crop, Rect{5, 6, 6, 7}, Rect{5, 6, 20, 25}}) {
            const Partial p = random_partial(kFrame, tile, splats, splats);
            const Result<EncodedPartial> encoded = encode_partial(p, kFrame);
            ASSERT_TRUE(encoded.ok()) << encoded.status().message();
            EXPECT_EQ(encoded->payload.size(), partial_payload_size(expectation_of(p, kFrame), splats));
            const Result<Partial> back = decode_partial(expectation_of(p, kFrame), encoded->descriptor, encoded->payload);
            ASSERT_TRUE(back.ok()) << back.status().message();
            EXPECT_TRUE(same(p, *back));
            EXPECT_EQ(encode_partial(*back, kFrame)->payload, encoded->payload);
        }
    }
}

/// One line of more than 2^31 bytes cannot be stored, however few pixels of a large frame have a splat.
TEST(PartialExr, SparseSplatsStayWithinALine) {
    const FrameLayout large{16384, 16384, {0, 0, 16384, 16384}};
    const PartialExpectation expected{large, {0, 0, 1, 1}, 1, 1};
    constexpr uint64_t kMost = uint64_t(INT32_MAX) / 28;
    EXPECT_LT(partial_payload_size(expected, kMost), (uint64_t(1) << 31) + 4096);
    EXPECT_GT(partial_payload_size(expected, kMost + 1), uint64_t(16384) * 16384 * 24);
}

TEST(PartialExr, IsAnExrThatOpenExrReads) {
    const uint32_t area = uint32_t(kFrame.crop.area());
    for (const uint32_t splats : {0u, 50u, area}) {
        const Rect tile{5, 6, 20, 25};
        const Partial p = random_partial(kFrame, tile, 9, splats);
        const EncodedPartial encoded = *encode_partial(p, kFrame);
        ExrMemoryInput stream("memory", encoded.payload);
        Imf::MultiPartInputFile file(stream);
        ASSERT_EQ(file.parts(), splats ? 2 : 1);
        for (int part_index = 0; part_index < file.parts(); ++part_index) {
            Imf::InputPart part(file, part_index);
            const Imath::Box2i window = part.header().dataWindow();
            const int w = window.max.x - window.min.x + 1, h = window.max.y - window.min.y + 1;
            std::map<std::string, std::vector<uint32_t>> planes;
            Imf::FrameBuffer buffer;
            for (auto it = part.header().channels().begin(); it != part.header().channels().end(); ++it) {
                std::vector<uint32_t>& plane = planes[it.name()];
                plane.resize(size_t(w) * size_t(h));
                char* base = reinterpret_cast<char*>(plane.data()) - (ptrdiff_t(window.min.y) * w + window.min.x) * 4;
                buffer.insert(it.name(), Imf::Slice(Imf::UINT, base, 4, size_t(w) * 4));
            }
            part.setFrameBuffer(buffer);
            part.readPixels(window.min.y, window.max.y);
            const auto value = [&](size_t i, char channel) {
                const std::string c(1, channel);
                return std::bit_cast<double>(uint64_t(planes["hi." + c][i]) << 32 | planes["lo." + c][i]);
            };
            if (part_index == 0) {
                EXPECT_EQ(part.header().name(), "camera");
                for (size_t i = 0; i < size_t(tile.area()); ++i) {
                    EXPECT_EQ(value(i, 'R'), p.camera[i * 3]);
                    EXPECT_EQ(value(i, 'G'), p.camera[i * 3 + 1]);
                    EXPECT_EQ(value(i, 'B'), p.camera[i * 3 + 2]);
                }
            } else {
                for (size_t i = 0; i < splats; ++i) {
                    EXPECT_EQ(value(i, 'G'), p.splats[i].rgb[1]);
                    if (splats != area) {
                        EXPECT_EQ(planes["pixel"][i], p.splats[i].pixel);
                    }
                }
            }
        }
    }
}

TEST(PartialExr, RefusesEveryFlippedByte) {
    const FrameLayout frame{9, 7, {1, 1, 8, 6}};
    for (const uint32_t splats : {0u, 5u, 35u}) {
        const Partial p = random_partial(frame, {2, 1, 6, 5}, 3, splats);
        const EncodedPartial encoded = *encode_partial(p, frame);
        std::string bytes = encoded.payload;
        for (size_t i = 0; i < bytes.size(); ++i) {
            for (const int bit : {0, 7}) {
                bytes[i] = char(bytes[i] ^ (1 << bit));
                PartialDescriptor d = encoded.descriptor;
                EXPECT_EQ(decode_partial(expectation_of(p, frame), d, bytes).status().code(), StatusCode::kDataLoss) << i;
                // A sender that signs what it sends: only pixel data may differ from what the unit predicts.
                d.payload_digest = sha256(bytes);
                const Result<Partial> back = decode_partial(expectation_of(p, frame), d, bytes);
                if (back.ok()) {
                    EXPECT_FALSE(same(*back, p)) << i;
                }
                bytes[i] = char(bytes[i] ^ (1 << bit));
            }
        }
        for (const size_t size : {size_t(0), size_t(1), size_t(4), bytes.size() / 2, bytes.size() - 1}) {
            PartialDescriptor d = encoded.descriptor;
            const std::string cut = bytes.substr(0, size);
            EXPECT_FALSE(decode_partial(expectation_of(p, frame), d, cut).ok());
            d.payload_size = size, d.payload_digest = sha256(cut);
            EXPECT_FALSE(decode_partial(expectation_of(p, frame), d, cut).ok());
        }
        PartialDescriptor d = encoded.descriptor;
        const std::string longer = bytes + "x";
        d.payload_size = longer.size(), d.payload_digest = sha256(longer);
        EXPECT_FALSE(decode_partial(expectation_of(p, frame), d, longer).ok());
    }
}

TEST(PartialExr, NeverCrashesOnRandomMutations) {
    const FrameLayout frame{9, 7, {1, 1, 8, 6}};
    // Another seed with --gtest_shuffle, for longer runs with --gtest_repeat.
    Rng rng({42 + uint64_t(::testing::UnitTest::GetInstance()->random_seed())});
    for (const uint32_t splats : {0u, 5u, 35u}) {
        const Partial p = random_partial(frame, {2, 1, 6, 5}, 3, splats);
        const EncodedPartial encoded = *encode_partial(p, frame);
        for (int round = 0; round < 40000; ++round) {
            std::string bytes = encoded.payload;
            PartialDescriptor d = encoded.descriptor;
            for (uint32_t k = rng.below(4); k > 0; --k) bytes[rng.below(uint32_t(bytes.size()))] = char(rng.next_u64());
            if (rng.below(4) == 0) bytes.resize(rng.below(uint32_t(bytes.size()) * 2));
            if (rng.below(4) == 0) d.splat_count = rng.next_u64() >> rng.below(64);
            if (rng.below(4) == 0) d.dropped_count = rng.next_u64() >> rng.below(64);
            d.payload_size = bytes.size();
            if (rng.below(2)) d.payload_digest = sha256(bytes);
            const Result<Partial> back = decode_partial(expectation_of(p, frame), d, bytes);
            if (back.ok()) {
                ASSERT_TRUE(check_partial(*back, frame).ok());
            }
        }
    }
}

TEST(PartialExr, RefusesNonFiniteSumsAndForeignUnits) {
    const Partial p = random_partial(kFrame, kFrame.crop, 3, 10);
    for (const double bad : {kNan, kInfinity}) {
        Partial broken = p;
        broken.camera[17] = bad;
        EXPECT_EQ(encode_partial(broken, kFrame).status().code(), StatusCode::kDataLoss);
        EncodedPartial encoded = *encode_partial(p, kFrame);
        // The upper word of the first pixel's blue sum comes first in the file.
        const std::string needle(reinterpret_cast<const char*>(&p.camera[2]) + 4, 4);
        const size_t at = encoded.payload.find(needle);
        ASSERT_NE(at, std::string::npos);
        const uint32_t high = uint32_t(std::bit_cast<uint64_t>(bad) >> 32);
        std::memcpy(encoded.payload.data() + at, &high, 4);
        encoded.descriptor.payload_digest = sha256(encoded.payload);
        EXPECT_EQ(decode_partial(expectation_of(p, kFrame), encoded.descriptor, encoded.payload).status().code(),
                  StatusCode::kDataLoss);
    }
    const EncodedPartial encoded = *encode_partial(p, kFrame);
    PartialExpectation other = expectation_of(p, kFrame);
    other.samples_per_pixel += 1;
    EXPECT_FALSE(decode_partial(other, encoded.descriptor, encoded.payload).ok());
    other = expectation_of(p, kFrame);
    other.light_paths += 1;
    EXPECT_FALSE(decode_partial(other, encoded.descriptor, encoded.payload).ok());
    other = expectation_of(p, kFrame);
    other.tile.x0 += 1;
    EXPECT_FALSE(decode_partial(other, encoded.descriptor, encoded.payload).ok());
}

TEST(PartialExr, IsNotAPicture) {
    const EncodedPartial partial = *encode_partial(random_partial(kFrame, kFrame.crop, 1, 5), kFrame);
    const Status status = decode_exr(partial.payload, "partial.exr").status();
    EXPECT_EQ(status.message(), "partial.exr: the EXR file has neither channels R, G and B nor Y");
}

TEST(PartialExr, RefusesAnEstimateThatIsNone) {
    for (const double bad : {kNan, kInfinity, -1.0}) {
        Partial p = random_partial(kFrame, kFrame.crop, 1, 5);
        p.rare_light.second_moment = bad;
        EXPECT_EQ(encode_partial(p, kFrame).status().code(), StatusCode::kDataLoss);
        p.rare_light = {{0, float(bad), 0}, {}, 1, 20};
        EXPECT_EQ(check_partial(p, kFrame).status().code(), StatusCode::kDataLoss);
    }
}

}  // namespace
}  // namespace lightloom
