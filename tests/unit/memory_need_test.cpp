// What a job's memory is estimated to be, and what is said of one that does not fit.
#include "server/memory_need.h"

#include <gtest/gtest.h>

#include "tests/support/algorithm_of.h"

namespace lightloom {
namespace {

constexpr uint64_t kMiB = uint64_t(1) << 20, kGB = 1'000'000'000;

JobSpec job(const char* algorithm, int width, int height, uint32_t spp) {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of(algorithm).completed();
    spec.samples_per_pixel = spp;
    spec.frame = {width, height, {0, 0, width, height}};
    return spec;
}

TEST(MemoryNeed, FollowsPixelsAndGroups) {
    const JobSpec path = job("path", 1000, 1000, 1), bdpt = job("bdpt", 1000, 1000, 1);
    const MemoryNeed small = memory_need(path, 512 * kMiB, 8 * kGB), splatting = memory_need(bdpt, 512 * kMiB, 8 * kGB);
    EXPECT_EQ(small.image, 48'000'000u);
    EXPECT_EQ(small.groups, 24'000'000u) << "one group is all that there is";
    EXPECT_EQ(splatting.image, 72'000'000u);
    EXPECT_EQ(splatting.groups, 48'000'000u);
    EXPECT_EQ(small.training, 0u);
    const MemoryNeed many = memory_need(job("bdpt", 1000, 1000, 1000), 512 * kMiB, 8 * kGB);
    EXPECT_EQ(many.groups, 48'000'000u * (1 + 512 * kMiB / 48'000'000));
    JobSpec layers = bdpt;
    layers.first_hit_layers = true;
    EXPECT_EQ(memory_need(layers, 512 * kMiB, 8 * kGB).layers, 28'000'000u);
    JobSpec timed = bdpt;
    timed.samples_per_pixel = 0;
    timed.time_limit_seconds = 60;
    EXPECT_EQ(memory_need(timed, 512 * kMiB, 8 * kGB).groups, many.groups) << "nobody knows how many there will be";
}

TEST(MemoryNeed, OfTrainingDataKeepsToTheirLimit) {
    const JobSpec spec = job("spcbpt", 100, 100, 4);
    const MemoryNeed need = memory_need(spec, 0, 8 * kGB);
    EXPECT_GT(need.training, 0u);
    EXPECT_EQ(memory_need(spec, 0, 1000).training, 1000u);
    EXPECT_EQ(need.peak(), std::max(need.training, need.image + std::max(need.groups, need.writing)));
}

TEST(MemoryNeed, IsSaidWhereItIsTooMuch) {
    const JobSpec spec = job("bdpt", 10000, 10000, 64);
    const MemoryNeed need = memory_need(spec, 512 * kMiB, 8 * kGB);
    ASSERT_GT(need.peak(), 10 * kGB);
    EXPECT_TRUE(check_memory(spec, need, 0, 0).ok());
    EXPECT_TRUE(check_memory(spec, need, 64 * kGB, 0).ok());
    const Status never = check_memory(spec, need, 8 * kGB, 0);
    EXPECT_EQ(never.code(), StatusCode::kResourceExhausted);
    EXPECT_EQ(never.message(),
              "the job's 100000000 pixels need about 12.0 GB (image 7.2, groups under way 4.8, writing it 4.8) of memory; the "
              "coordinator's host has 8.0 GB; lower the resolution or give a crop window");
    const Status later = check_memory(spec, need, 16 * kGB, 10 * kGB);
    EXPECT_NE(later.message().find("of which other jobs need 10.0; submit it again when they have ended"), std::string::npos)
        << later.message();
    const JobSpec learner = job("spcbpt", 8, 8, 4);
    MemoryNeed training = memory_need(learner, 0, 8 * kGB);
    training.training = 9 * kGB;
    EXPECT_NE(check_memory(learner, training, 8 * kGB, 0).message().find("fewer training-paths"), std::string::npos);
}

}  // namespace
}  // namespace lightloom
