// The tables behind the coats: their bits, which are in every image with a coat, and how often they are computed.

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "common/core/digest.h"
#include "common/scene/bsdf_tables.h"

namespace lightloom {
namespace {

std::string digest_of(const DirectionalTable& table) {
    std::string bytes(sizeof table, '\0');
    std::memcpy(bytes.data(), &table, sizeof table);
    return sha256(bytes).hex();
}

/// Recorded from a build without optimisation, which computes one point after the other: vector instructions change nothing.
TEST(CoatTables, HaveTheBitsOfOnePointAfterTheOther) {
    EXPECT_EQ(digest_of(coat_table(1.5f, 0.01f)), "9c95d996309194de0cb9fbea45ee6d386b8c23cde8f6310a8230b0a592310c9a");
    EXPECT_EQ(digest_of(coat_table(1.3f, 0.2f)), "1b93e5fe3c94c120040ced03a5fe6a95072cfb5e836f8f7b39824e8d89f5db5a");
    EXPECT_EQ(digest_of(coat_table(1 / 1.5f, 0)), "e2fcb8561d8b6592d9e38c8cf3374fd70a98088ada72d8934af2eb6c11c5a149");
    EXPECT_EQ(digest_of(trapped_table(1.5f)), "97de5b7ba0d758d609ac0a0e96dba3110e565b302210a72f43216fa1ad944955");
}

TEST(CoatTables, AreComputedOnceHoweverManyThreadsNeedThem) {
    const uint64_t before = coat_table_rows_built();
    std::vector<std::string> digests(8);
    {
        std::vector<std::jthread> threads;
        for (std::string& digest : digests) threads.emplace_back([&digest] { digest = digest_of(coat_table(1.7f, 0.03f)); });
    }
    EXPECT_EQ(coat_table_rows_built() - before, uint64_t(DirectionalTable::kAlphas));
    for (const std::string& digest : digests) EXPECT_EQ(digest, digests[0]);
    EXPECT_EQ(digest_of(coat_table(1.7f, 0.03f)), digests[0]);
    EXPECT_EQ(coat_table_rows_built() - before, uint64_t(DirectionalTable::kAlphas));
    (void)coat_table(1.7f, 0.04f);  // another coat is another table
    EXPECT_EQ(coat_table_rows_built() - before, 2 * uint64_t(DirectionalTable::kAlphas));
}

}  // namespace
}  // namespace lightloom
