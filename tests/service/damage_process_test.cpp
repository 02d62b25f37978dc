// Files of a scene that are damaged in the stores of coordinator and workers.

#include <gtest/gtest.h>

#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::Service;
namespace fs = std::filesystem;

/// Flips a bit in the middle of every complete file of a store; how many there are.
int damage(const fs::path& store) {
    int count = 0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(store)) {
        if (!entry.is_regular_file() || entry.path().parent_path().filename() == "incoming") continue;
        std::string bytes = *read_file(entry.path().string());
        bytes[bytes.size() / 2] ^= 1;
        EXPECT_TRUE(write_file_atomically(entry.path().string(), bytes).ok());
        ++count;
    }
    return count;
}

const std::vector<std::string> kBefore{"--spp", "2", "--resolution", "16x12"}, kAfter{"--spp", "3", "--resolution", "16x12"};

/// The image that an undisturbed render makes of kAfter.
Digest undisturbed(const Service& service) {
    std::vector<std::string> arguments{"render", testing::kScene, "-q", "-o", service.path("alone.exr"), "--threads", "1"};
    arguments.insert(arguments.end(), kAfter.begin(), kAfter.end());
    EXPECT_EQ(testing::Process("lightloom", arguments, service.path("alone.log")).wait(), 0) << service.log("alone");
    return service.digest("alone");
}

TEST(Damage, OfFilesInTheCoordinatorsStoreIsRepairedByTheClientThatSubmits) {
    const Service service;
    const auto worker = service.worker("worker", 1);
    ASSERT_EQ(service.submit("before", kBefore)->wait(), 0) << service.log("before") << service.log("server");
    ASSERT_GE(damage(service.path("data/assets")), 2) << "the scene file and the list of files";
    ASSERT_EQ(service.submit("after", kAfter)->wait(), 0) << service.log("after") << service.log("server");
    EXPECT_EQ(service.digest("after"), undisturbed(service));
    EXPECT_NE(service.log("after").find("\"cornell.pbrt\" of the scene was damaged on disk and is removed"), std::string::npos)
        << service.log("after");
}

TEST(Damage, OfAWorkersCopiesIsRepairedByFetchingThemAgain) {
    const Service service;
    {
        const auto worker = service.worker("first", 1);
        ASSERT_EQ(service.submit("before", kBefore)->wait(), 0) << service.log("before") << service.log("server");
    }
    ASSERT_GE(damage(service.path("cache/assets")), 2);
    const auto worker = service.worker("second", 1);
    ASSERT_EQ(service.submit("after", kAfter)->wait(), 0) << service.log("after") << service.log("second");
    EXPECT_EQ(service.digest("after"), undisturbed(service));
    EXPECT_NE(service.log("second").find("are fetched again"), std::string::npos) << service.log("second");
}

}  // namespace
}  // namespace lightloom
