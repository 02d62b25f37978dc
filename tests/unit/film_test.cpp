// The exact accumulation and the partial codec.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "common/core/rng.h"
#include "common/film/accumulation.h"
#include "common/film/exr_io.h"
#include "common/film/exr_memory.h"
#include "common/film/grouped_sum.h"
#include "common/film/partial_exr.h"

namespace lightloom {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const FrameLayout kFrame{40, 30, {4, 3, 36, 27}};

/// A partial with radiance-like sums around `scale`; `splats` random pixels get a splat sum.
Partial random_partial(const FrameLayout& frame, const Rect& tile, uint64_t seed, uint32_t splats, double scale = 1) {
    Rng rng({seed});
    Partial partial;
    partial.tile = tile;
    partial.samples_per_pixel = 4;
    partial.camera.resize(size_t(tile.area()) * 3);
    for (double& v : partial.camera) v = scale * rng.uniform_double() * (1 << rng.below(12));
    partial.light_paths = 4 * uint64_t(tile.area());
    std::vector<uint32_t> pixels(size_t(frame.crop.area()));
    std::iota(pixels.begin(), pixels.end(), 0u);
    for (uint32_t i = 0; i < splats; ++i) {
        std::swap(pixels[i], pixels[i + rng.below(uint32_t(pixels.size()) - i)]);
    }
    std::sort(pixels.begin(), pixels.begin() + splats);
    for (uint32_t i = 0; i < splats; ++i) {
        const double r = rng.uniform_double(), g = rng.uniform_double(), b = 0.1 + rng.uniform_double();
        partial.splats.push_back({pixels[i], {scale * r, scale * g, scale * b}});
    }
    partial.counters = {partial.samples_per_pixel * uint64_t(tile.area()), partial.light_paths, 1000 + seed, 77, 5};
    partial.dropped_count = 20;
    partial.dropped = {{seed, 3, true}, {seed + 1, 7, false}};
    return partial;
}

std::vector<Rect> four_tiles(const Rect& crop) {
    const int xm = crop.x0 + crop.width() / 3, ym = crop.y0 + crop.height() / 2;
    return {{crop.x0, crop.y0, xm, ym}, {xm, crop.y0, crop.x1, ym}, {crop.x0, ym, xm, crop.y1}, {xm, ym, crop.x1, crop.y1}};
}

bool same(const Partial& a, const Partial& b) {
    return a.tile == b.tile && a.samples_per_pixel == b.samples_per_pixel && a.camera == b.camera &&
           a.light_paths == b.light_paths && a.splats == b.splats && a.dropped_count == b.dropped_count && a.dropped == b.dropped &&
           a.counters.rays == b.counters.rays;
}

PartialExpectation expectation_of(const Partial& p, const FrameLayout& frame) {
    return {frame, p.tile, p.samples_per_pixel, p.light_paths};
}

// ---------------------------------------------------------------------------------------------------- accumulation

RgbImage develop_in_order(const std::vector<Partial>& partials, const std::vector<size_t>& order) {
    GroupSum group(kFrame);
    for (size_t i : order) EXPECT_TRUE(group.add(partials[i]).ok());
    Accumulation total(kFrame);
    EXPECT_TRUE(total.fold(group, 4).ok());
    return total.develop();
}

TEST(Accumulation, OrderOfArrivalDoesNotMatter) {
    std::vector<Partial> partials;
    for (const Rect& tile : four_tiles(kFrame.crop)) {
        // Magnitudes that make double addition depend on the order.
        partials.push_back(random_partial(kFrame, tile, partials.size(), 300, std::pow(1e5, double(partials.size()))));
    }
    std::vector<size_t> order{0, 1, 2, 3};
    const RgbImage first = develop_in_order(partials, order);
    while (std::next_permutation(order.begin(), order.end())) {
        EXPECT_EQ(develop_in_order(partials, order).pixels, first.pixels);
    }
}

TEST(Accumulation, DevelopsSumsOverCounts) {
    const FrameLayout frame{2, 1, {0, 0, 2, 1}};
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 2;
    p.camera = {2, 4, 6, 8, 10, 12};
    p.light_paths = 8;
    p.splats = {{1, {16, 0, 8}}};
    GroupSum group(frame);
    ASSERT_TRUE(group.add(p).ok());
    Accumulation total(frame);
    ASSERT_TRUE(total.fold(group, 2).ok());
    EXPECT_EQ(total.develop().pixels, (std::vector<float>{1, 2, 3, 4 + 2, 5, 6 + 1}));
    EXPECT_EQ(total.iterations(), 2u);
    EXPECT_TRUE(total.variance().pixels.empty()) << "one group says nothing of it";
}

TEST(Accumulation, VarianceComesFromGroupImages) {
    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    Accumulation total(frame);
    // Groups of 1, 1 and 2 iterations whose images are 1, 3 and 5: mean 3.5, sum n (X - mean)^2 = 6.25 + 0.25 + 4.5.
    for (const auto& [n, value] : {std::pair<uint32_t, double>{1, 1}, {1, 3}, {2, 5}}) {
        Partial p;
        p.tile = frame.crop;
        p.samples_per_pixel = n;
        p.camera = {n * value, 0, 0};
        GroupSum group(frame);
        ASSERT_TRUE(group.add(p).ok());
        ASSERT_TRUE(total.fold(group, n).ok());
    }
    EXPECT_FLOAT_EQ(total.develop().pixels[0], 3.5f);
    EXPECT_FLOAT_EQ(total.variance().pixels[0], 11.0f / (2 * 4));
}

TEST(Accumulation, DevelopsAsTheFilmResponds) {
    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    // Green takes half of red and blue, which varies with red: the variance of the sum is not the sum of variances.
    const FilmResponse response{2, {{{1, 0, 0}, {0.5, 0, 0.5}, {0, 0.25, 1}}}};
    Accumulation total(frame, response), green(frame), neutral(frame, {2, FilmResponse::kNeutral});
    for (const auto& [r, b] : {std::pair<double, double>{1, 2}, {3, 6}, {5, 4}}) {
        const auto fold = [&](Accumulation* to, std::vector<double> camera) {
            Partial p;
            p.tile = frame.crop;
            p.samples_per_pixel = 1;
            p.camera = std::move(camera);
            GroupSum group(frame);
            ASSERT_TRUE(group.add(p).ok());
            ASSERT_TRUE(to->fold(group, 1).ok());
        };
        fold(&total, {r, 8, b});
        fold(&neutral, {r, 8, b});
        fold(&green, {0, r + b, 0});
    }
    EXPECT_EQ(total.develop().pixels, (std::vector<float>{6, 7, 12}));
    EXPECT_EQ(neutral.develop().pixels, (std::vector<float>{6, 16, 8}));
    EXPECT_FLOAT_EQ(total.variance().pixels[0], 4 * 8.0f / (2 * 3));
    EXPECT_FLOAT_EQ(total.variance().pixels[1], green.variance().pixels[1]);
    EXPECT_FLOAT_EQ(neutral.variance().pixels[0], total.variance().pixels[0]);
}

TEST(Accumulation, ScalesWithTheLights) {
    for (const double factor : {1e6, 1e-6}) {
        GroupSum plain(kFrame), scaled(kFrame);
        for (const Rect& tile : four_tiles(kFrame.crop)) {
            Partial p = random_partial(kFrame, tile, 5, 200, 0.25);
            ASSERT_TRUE(plain.add(p).ok());
            for (double& v : p.camera) v *= factor;
            for (SplatSum& s : p.splats) {
                for (double& v : s.rgb) v *= factor;
            }
            ASSERT_TRUE(scaled.add(p).ok());
        }
        Accumulation a(kFrame), b(kFrame);
        ASSERT_TRUE(a.fold(plain, 4).ok());
        ASSERT_TRUE(b.fold(scaled, 4).ok());
        const RgbImage x = a.develop(), y = b.develop();
        for (size_t i = 0; i < x.pixels.size(); ++i) {
            if (x.pixels[i] > 0.05f) {
                ASSERT_NEAR(y.pixels[i] / (x.pixels[i] * factor), 1, 1e-6) << factor << " " << i;
            }
        }
    }
}

TEST(Accumulation, RefusesNonFiniteAndAddsNothing) {
    for (const double bad : {kNan, kInfinity, -kInfinity, 1e26, -1e300}) {
        for (const bool splat : {false, true}) {
            GroupSum group(kFrame);
            Partial good = random_partial(kFrame, kFrame.crop, 1, 10);
            Partial p = good;
            (splat ? p.splats.back().rgb[2] : p.camera.back()) = bad;
            EXPECT_EQ(group.add(p).code(), StatusCode::kDataLoss);
            ASSERT_TRUE(group.add(good).ok());
            Accumulation total(kFrame);
            EXPECT_TRUE(total.fold(group, 4).ok());
        }
    }
}

TEST(Accumulation, RefusesSumsBeyondTheRange) {
    const FrameLayout frame{2, 1, {0, 0, 2, 1}};
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 1;
    p.camera = {9e24, 0, 0, 1, 1, 1};
    GroupSum group(frame);
    ASSERT_TRUE(group.add(p).ok());
    EXPECT_EQ(group.add(p).code(), StatusCode::kDataLoss);
    p.camera = {-9e24, 0, 0, 0, 9e24, 0};  // Fits, although the bounds alone could not tell.
    ASSERT_TRUE(group.add(p).ok());
    Accumulation total(frame);
    ASSERT_TRUE(total.fold(group, 2).ok());
    EXPECT_EQ(total.develop().pixels[0], 0.0f);
    EXPECT_FLOAT_EQ(total.develop().pixels[4], 4.5e24f);
}

TEST(Accumulation, FoldsOnlyCompleteGroups) {
    GroupSum group(kFrame);
    const std::vector<Rect> tiles = four_tiles(kFrame.crop);
    for (size_t i = 0; i < 3; ++i) ASSERT_TRUE(group.add(random_partial(kFrame, tiles[i], i, 10)).ok());
    Accumulation total(kFrame);
    EXPECT_EQ(total.fold(group, 4).code(), StatusCode::kFailedPrecondition);
    ASSERT_TRUE(group.add(random_partial(kFrame, tiles[3], 3, 10)).ok());
    EXPECT_EQ(total.fold(group, 5).code(), StatusCode::kFailedPrecondition);
    EXPECT_TRUE(total.fold(group, 4).ok());
    EXPECT_EQ(total.dropped(), 80u);
}

/// Partials of a whole group of kFrame; `seed` tells groups apart.
std::vector<Partial> group_of(uint64_t seed) {
    std::vector<Partial> partials;
    for (const Rect& tile : four_tiles(kFrame.crop))
        partials.push_back(random_partial(kFrame, tile, 10 * seed + partials.size(), 50));
    return partials;
}

/// Mutation: GroupedSum::add() that counts before it adds fails this.
TEST(GroupedSum, ARefusedUnitLeavesTheSumsAsTheyWere) {
    for (const double bad : {kNan, 1e26}) {
        GroupedSum plain(kFrame), tried(kFrame);
        for (const Partial& partial : group_of(1)) {
            Partial broken = partial;
            broken.camera.back() = bad;
            EXPECT_EQ(tried.add(broken).code(), StatusCode::kDataLoss);
            broken = partial;
            broken.splats.back().rgb[0] = bad;
            EXPECT_EQ(tried.add(broken).code(), StatusCode::kDataLoss);
            EXPECT_EQ(tried.current_units(), plain.current_units());
            ASSERT_TRUE(plain.add(partial).ok());
            ASSERT_TRUE(tried.add(partial).ok());
        }
        ASSERT_TRUE(plain.fold(4).ok());
        ASSERT_TRUE(tried.fold(4).ok());
        EXPECT_EQ(tried.complete().develop().pixels, plain.complete().develop().pixels);
        EXPECT_EQ(tried.complete().dropped(), plain.complete().dropped());
        EXPECT_EQ(tried.counters().rays, plain.counters().rays);
    }
}

TEST(GroupedSum, OnlyCompleteGroupsAreSeen) {
    GroupedSum sums(kFrame);
    EXPECT_EQ(sums.fold(4).status().code(), StatusCode::kFailedPrecondition) << "no unit yet";
    Accumulation all(kFrame);
    uint64_t rays = 0;
    for (uint32_t g = 0; g < 3; ++g) {
        GroupSum alone(kFrame);
        for (const Partial& partial : group_of(g)) {
            ASSERT_TRUE(sums.add(partial).ok());
            ASSERT_TRUE(alone.add(partial).ok());
            EXPECT_EQ(sums.complete().develop().pixels, all.develop().pixels) << "a unit of a group that is not complete";
            EXPECT_EQ(sums.complete().dropped(), 80u * g);
            EXPECT_EQ(sums.counters().rays, rays);
        }
        EXPECT_EQ(sums.current_units(), 4u);
        for (const Partial& partial : group_of(g)) rays += partial.counters.rays;
        const Result<GroupSum> folded = sums.fold(4);
        ASSERT_TRUE(folded.ok());
        ASSERT_TRUE(all.fold(alone, 4).ok());
        EXPECT_EQ(sums.current_units(), 0u);
        EXPECT_EQ(sums.counters().rays, rays);
        EXPECT_EQ(sums.complete().group_count(), g + 1);
        EXPECT_EQ(sums.complete().develop().pixels, all.develop().pixels);
        // What is given back are this group's own sums.
        Accumulation one(kFrame), other(kFrame);
        ASSERT_TRUE(one.fold(*folded, 4).ok());
        ASSERT_TRUE(other.fold(alone, 4).ok());
        EXPECT_EQ(one.develop().pixels, other.develop().pixels);
    }
    EXPECT_EQ(sums.complete().variance().pixels, all.variance().pixels);
}

/// A group that lacks a unit, has one twice, or leaves the range only together with the others.
TEST(GroupedSum, AGroupThatDoesNotFitIsNoPartOfTheImage) {
    GroupedSum sums(kFrame);
    const std::vector<Partial> units = group_of(1);
    for (const Partial& partial : units) ASSERT_TRUE(sums.add(partial).ok());
    ASSERT_TRUE(sums.fold(4).ok());
    const RgbImage before = sums.complete().develop();
    const uint64_t rays = sums.counters().rays;
    const auto unchanged = [&] {
        EXPECT_EQ(sums.complete().group_count(), 1u);
        EXPECT_EQ(sums.complete().develop().pixels, before.pixels);
        EXPECT_EQ(sums.counters().rays, rays);
    };
    ASSERT_TRUE(sums.add(units[0]).ok());
    EXPECT_EQ(sums.fold(4).status().code(), StatusCode::kFailedPrecondition);
    unchanged();
    sums.drop_current();
    EXPECT_EQ(sums.current_units(), 0u);
    for (const Partial& partial : units) ASSERT_TRUE(sums.add(partial).ok());
    ASSERT_TRUE(sums.add(units[0]).ok()) << "exactly-once is the caller's duty";
    EXPECT_EQ(sums.fold(4).status().code(), StatusCode::kFailedPrecondition);
    unchanged();

    const FrameLayout frame{1, 1, {0, 0, 1, 1}};
    GroupedSum bright(frame);
    Partial p;
    p.tile = frame.crop;
    p.samples_per_pixel = 1;
    p.camera = {9e24, 0, 0};
    ASSERT_TRUE(bright.add(p).ok());
    ASSERT_TRUE(bright.fold(1).ok());
    ASSERT_TRUE(bright.add(p).ok());
    EXPECT_EQ(bright.fold(1).status().code(), StatusCode::kDataLoss);
    EXPECT_EQ(bright.complete().iterations(), 1u);
}

TEST(FixedSums, EqualPlain128BitSums) {
    Rng rng({99});
    FixedSums sums(3), all(3);
    __int128 plain[3] = {};
    for (int round = 0; round < 100000; ++round) {
        // All magnitudes from below a step to far beyond 64 bits, both signs, so that borrows and carries occur.
        double values[3], largest = 0;
        const int top = int(rng.below(130)) - 50;
        for (double& v : values) {
            v = std::ldexp(rng.uniform_double() - 0.5, top - int(rng.below(30)));
            largest = std::max(largest, std::fabs(v));
        }
        if (round % 1000 == 0) values[0] = 0.5 * 0x1p-44, values[1] = 1.5 * 0x1p-44, values[2] = -2.5 * 0x1p-44;
        sums.add(0, values, 3, std::max(largest, 1e-12));
        for (int i = 0; i < 3; ++i) {
            // Rounding to nearest even by the remainder, in wide arithmetic of its own.
            const double steps = std::ldexp(values[i], 44), whole = std::floor(steps), rest = steps - whole;
            __int128 rounded = __int128(whole);
            if (rest > 0.5 || (rest == 0.5 && (rounded & 1))) rounded += 1;
            plain[i] += rounded;
            ASSERT_TRUE(sums.steps(size_t(i)) == plain[i]) << round;
        }
    }
    all.add(sums);
    all.add(sums);
    for (size_t i = 0; i < 3; ++i) {
        EXPECT_TRUE(all.steps(i) == 2 * plain[i]);
        EXPECT_EQ(all.value(i), double(2 * plain[i]) * 0x1p-44);
    }
}

// ---------------------------------------------------------------------------------------------------- partial codec

TEST(PartialExr, RoundTripsBitForBit) {
    const uint32_t area = uint32_t(kFrame.crop.area());
    for (const uint32_t splats : {0u, 1u, area / 4, area * 6 / 7 - 1, area * 6 / 7 + 1, area}) {
        for (const Rect& tile : {kFrame.crop, Rect{5, 6, 6, 7}, Rect{5, 6, 20, 25}}) {
            const Partial p = random_partial(kFrame, tile, splats, splats);
            const Result<EncodedPartial> encoded = encode_partial(p, kFrame);
            ASSERT_TRUE(encoded.ok()) << encoded.status().message();
            EXPECT_EQ(encoded->payload.size(), partial_payload_size(kFrame, tile, splats));
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
    const Rect tile{0, 0, 1, 1};
    constexpr uint64_t kMost = uint64_t(INT32_MAX) / 28;
    EXPECT_LT(partial_payload_size(large, tile, kMost), (uint64_t(1) << 31) + 4096);
    EXPECT_GT(partial_payload_size(large, tile, kMost + 1), uint64_t(16384) * 16384 * 24);
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
    Rng rng({42 + uint64_t(testing::UnitTest::GetInstance()->random_seed())});
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

}  // namespace
}  // namespace lightloom
