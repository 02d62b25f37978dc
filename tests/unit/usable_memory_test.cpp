// Limits of control groups, as the kernel's files have them.

#include "common/core/usable_memory.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

constexpr uint64_t kNone = std::numeric_limits<uint64_t>::max();

struct Groups {
    void limit(const std::string& file, const std::string& text) const {
        const std::filesystem::path path = directory.path / file;
        std::filesystem::create_directories(path.parent_path());
        std::ofstream(path) << text << "\n";
    }
    testing::TempDirectory directory;
};

TEST(UsableMemory, IsSomeOfTheMachines) {
    EXPECT_GT(usable_memory(), uint64_t(1) << 20);
    EXPECT_LT(usable_memory(), uint64_t(1) << 50);
}

TEST(UsableMemory, TheLeastLimitOfAllGroupsAboveHolds) {
    const Groups groups;
    groups.limit("memory.max", "max");
    groups.limit("farm.slice/memory.max", "2147483648");
    groups.limit("farm.slice/worker.service/memory.max", "4294967296");
    EXPECT_EQ(control_group_limit("0::/farm.slice/worker.service\n", groups.directory.path), 2147483648u);
    EXPECT_EQ(control_group_limit("0::/\n", groups.directory.path), kNone);
    EXPECT_EQ(control_group_limit("0::/gone/worker\n", groups.directory.path), kNone);
    groups.limit("memory.max", "1000000");  // in a container the own group is the root
    EXPECT_EQ(control_group_limit("0::/gone/worker\n", groups.directory.path), 1000000u);
}

TEST(UsableMemory, TheFirstVersionOfControlGroupsHasAMountForMemory) {
    const Groups groups;
    groups.limit("memory/docker/7/memory.limit_in_bytes", "3000000");
    groups.limit("cpu/docker/7/memory.limit_in_bytes", "1");
    EXPECT_EQ(control_group_limit("5:cpu,cpuacct:/docker/7\n4:memory:/docker/7\n0::/\n", groups.directory.path), 3000000u);
}

TEST(UsableMemory, WhatIsNoMembershipIsNoLimit) {
    const Groups groups;
    groups.limit("memory.max", "7");
    for (const char* text : {"", "\n", "nonsense", "0:", "1:memory"})
        EXPECT_EQ(control_group_limit(text, groups.directory.path), kNone);
}

}  // namespace
}  // namespace lightloom
