// Results that are not what they seem: 10^5 mutated partials, half of them with a digest that fits, and 10^4 repeated ones.

#include <gtest/gtest.h>

#include "common/film/partial_exr.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::fake_partial;
using testing::FakeService;

constexpr int kMutations = 100000, kReplays = 10000;

const FrameLayout kSmall{12, 9, {0, 0, 12, 9}};

TEST(Mutations, NothingIsReadThatNoWorkerWouldHaveSent) {
    const Plan plan(kSmall, {.light_paths_per_iteration = 50});
    const RenderUnit work = plan.units(plan.group(0))[0].render;
    const PartialExpectation expected{kSmall, work.tile, work.samples_per_pixel(), work.light_path_count};
    const EncodedPartial good = *encode_partial(fake_partial(work, kSmall), kSmall);
    ASSERT_TRUE(decode_partial(expected, good.descriptor, good.payload).ok());
    Rng rng({28, Stage::kCamera, 0, 0});
    int refused = 0, other_sums = 0;
    for (int i = 0; i < kMutations; ++i) {
        EncodedPartial bad = good;
        PartialExpectation unit = expected;
        bool sums_at_most = false;
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
                sums_at_most = true;
            }
        }
        const bool digest_fits = i % 2 == 0;
        if (digest_fits) {
            bad.descriptor.payload_digest = sha256(bad.payload);
            if (rng.below(2) == 0) bad.descriptor.payload_size = bad.payload.size();
        }
        const auto read = decode_partial(unit, bad.descriptor, bad.payload);
        if (!read.ok()) {
            ++refused;
            ASSERT_FALSE(read.status().message().empty());
            continue;
        }
        // What is left are other finite sums, or sums of other pixels, in a file of exactly the right form: another result, for
        // which only its worker can answer.
        ASSERT_TRUE(sums_at_most && digest_fits) << "mutation " << i;
        const auto again = encode_partial(*read, kSmall);
        ASSERT_TRUE(again.ok() && again->payload == bad.payload) << "mutation " << i;
        ++other_sums;
    }
    EXPECT_EQ(refused + other_sums, kMutations);
    EXPECT_GT(refused, 8 * kMutations / 10);
    EXPECT_GT(other_sums, kMutations / 50);
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
