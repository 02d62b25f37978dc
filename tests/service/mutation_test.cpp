// Results that are not what they seem: 10^5 mutated partials, half of them with a digest that fits, and 10^4 repeated ones.

#include <gtest/gtest.h>

#include <cstring>

#include "common/film/partial_exr.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::fake_partial;
using testing::FakeService;

constexpr int kMutations = 100000, kReplays = 10000;

const FrameLayout kSmall{12, 9, {0, 0, 12, 9}};

/// The bytes of a payload that are not sums, as two partials of the same unit with other sums show.
std::vector<bool> structure_of(const EncodedPartial& a, const EncodedPartial& b) {
    std::vector<bool> structure(a.payload.size());
    for (size_t i = 0; i < structure.size(); ++i) structure[i] = a.payload[i] == b.payload[i];
    return structure;
}

/// All sums positive and different in every byte from those of the other sign and size.
EncodedPartial encoded(const RenderUnit& work, double scale) {
    Partial partial = fake_partial(work, kSmall);
    Rng rng({uint64_t(scale * 1000), Stage::kCamera, 1, 2});
    const auto any_number = [&] {
        uint64_t bits = rng.next_u64();
        bits = (bits & ~(uint64_t(0x7ff) << 52)) | ((uint64_t(963) + bits % 140) << 52);
        double value = 0;
        std::memcpy(&value, &bits, sizeof value);
        return std::abs(value) * scale;
    };
    for (double& sum : partial.camera) sum = any_number();
    for (auto& splat : partial.splats)
        for (double& sum : splat.rgb) sum = any_number();
    auto out = encode_partial(partial, kSmall);
    EXPECT_TRUE(out.ok());
    return *std::move(out);
}

TEST(Mutations, NoPartialWithAnotherStructureIsRead) {
    const Plan plan(kSmall, {.light_paths_per_iteration = 50});
    const RenderUnit work = plan.units(plan.group(0))[0].render;
    const PartialExpectation expected{kSmall, work.tile, work.samples_per_pixel(), work.light_path_count};
    const EncodedPartial good = encoded(work, 1);
    ASSERT_TRUE(decode_partial(expected, good.descriptor, good.payload).ok());
    std::vector<bool> structure(good.payload.size(), true);
    for (int i = 2; i < 12; ++i) {
        const auto same = structure_of(good, encoded(work, i));
        for (size_t byte = 0; byte < structure.size(); ++byte) structure[byte] = structure[byte] && same[byte];
    }
    Rng rng({28, Stage::kCamera, 0, 0});
    int structural = 0, values = 0;
    for (int i = 0; i < kMutations; ++i) {
        EncodedPartial bad = good;
        PartialExpectation unit = expected;
        bool touches_structure = true;
        switch (rng.below(8)) {
            case 0: bad.payload.resize(rng.below(uint32_t(bad.payload.size()))); break;
            case 1: bad.payload.append(1 + rng.below(64), char(rng.next_u64())); break;
            case 2: bad.descriptor.splat_count += 1 + rng.below(5); break;
            case 3: bad.descriptor.samples_per_pixel += 1 + rng.below(3); break;
            case 4: bad.descriptor.light_paths += 1 + rng.below(100); break;
            case 5: unit.tile.x1 -= 1 + int(rng.below(3)); break;  // the payload is of another unit
            default: {
                const size_t byte = rng.below(uint32_t(bad.payload.size()));
                bad.payload[byte] = char(bad.payload[byte] ^ (1 << rng.below(8)));
                touches_structure = structure[byte];
            }
        }
        const bool digest_fits = i % 2 == 0;
        if (digest_fits) {
            bad.descriptor.payload_digest = sha256(bad.payload);
            if (rng.below(2) == 0) bad.descriptor.payload_size = bad.payload.size();
        }
        const auto read = decode_partial(unit, bad.descriptor, bad.payload);
        if (touches_structure || !digest_fits) {
            ++structural;
            ASSERT_FALSE(read.ok()) << "mutation " << i;
            ASSERT_FALSE(read.status().message().empty());
        } else {
            ++values;  // other finite numbers are another result, which only its worker can answer for
            if (!read.ok()) continue;
            for (const double sum : read->camera) ASSERT_TRUE(std::isfinite(sum));
        }
    }
    EXPECT_GT(structural, 8 * kMutations / 10);
    EXPECT_GT(values, kMutations / 50);
}

TEST(Replays, AreNeverMergedTwice) {
    const auto render = [](int replays) {
        FakeService service(kSmall);
        const std::string id = service.submit(service.spec(40));
        const std::string worker = service.add_worker(), liar = service.add_worker();
        std::vector<UnitLease> delivered;
        Rng rng({29, Stage::kCamera, 0, 0});
        auto leases = service.lease(worker);
        // The last unit is held back, so that the job runs as long as results are repeated.
        for (auto next = service.lease(worker); !next.empty(); next = service.lease(worker)) {
            EXPECT_EQ(service.deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
            delivered.push_back(leases[0]);
            leases = next;
        }
        for (int i = 0; i < replays; ++i) {
            const UnitLease& again = delivered[rng.below(uint32_t(delivered.size()))];
            if (service.deliver(rng.below(2) ? worker : liar, again).outcome != SubmitOutcome::kDuplicateSame) {
                ADD_FAILURE() << "replay " << i;
                break;
            }
        }
        EXPECT_EQ(service.coordinator->get_job(id)->duplicates_same, uint64_t(replays));
        EXPECT_EQ(service.deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
        const JobInfo info = service.wait_end(id);
        EXPECT_EQ(info.camera_samples, 40u * uint64_t(kSmall.crop.area()));
        return info.image_digest;
    };
    EXPECT_EQ(render(kReplays), render(0));
}

}  // namespace
}  // namespace lightloom
