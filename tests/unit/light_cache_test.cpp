// Where light sub-paths are kept: pages that several threads fill, and the spare pages between units.

#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "common/transport/light_cache.h"

namespace lightloom {
namespace {

/// A path of n vertices that can be told apart from all others.
std::vector<PathVertex> marked_path(uint32_t number, int n) {
    std::vector<PathVertex> y(static_cast<size_t>(n));
    for (int i = 0; i < n; ++i) y[size_t(i)].fwd = number, y[size_t(i)].rev = i;
    return y;
}

TEST(LightCache, ThreadsAppendPathsThatStayWhole) {
    constexpr uint32_t kThreads = 4, kPaths = 4000;
    LightCache cache;
    cache.paths.resize(kThreads * kPaths);
    const auto length = [](uint32_t m) { return m % 500 == 7 ? kMaxEdges + 2 : int(m % 6); };
    {
        std::vector<std::jthread> threads;
        for (uint32_t t = 0; t < kThreads; ++t) {
            threads.emplace_back([&, t] {
                for (uint32_t m = t; m < kThreads * kPaths;) {
                    LightCache::Writer writer(cache);  // many short ones: they go on where others stopped
                    for (int i = 0; i < 50 && m < kThreads * kPaths; ++i, m += kThreads)
                        cache.paths[m] = writer.append(marked_path(m, length(m)).data(), length(m));
                }
            });
        }
    }
    uint64_t total = 0;
    uint32_t last = 0;
    for (uint32_t m = 0; m < cache.path_count(); ++m) {
        const LightCache::Path path = cache.paths[m];
        ASSERT_EQ(int(path.length), length(m));
        if (path.length == 0) continue;
        const PathVertex* y = cache.at(path.first_vertex);
        for (int i = 0; i < length(m); ++i) ASSERT_TRUE(y[i].fwd == m && y[i].rev == i) << m << " " << i;
        total += path.length;
        last = std::max(last, path.first_vertex);
    }
    // Every page holds 2^13 numbers, of which not all are used; what a writer leaves of a page is filled by another.
    EXPECT_LT(last / 8192.0, 1.15 * double(total) / double(HugePage::kBytes / sizeof(PathVertex)) + kThreads);
}

TEST(HugePage, IsKeptForTheNextOwnerUpToABound) {
    if (HugePage::kMostKeptBytes == 0) GTEST_SKIP() << "this build keeps no pages";
    std::set<const std::byte*> first;
    {
        std::vector<HugePage> pages(3);
        for (const HugePage& page : pages) first.insert(page.data());
        std::fill_n(pages[0].data(), HugePage::kBytes, std::byte{1});
    }
    {
        std::vector<HugePage> again(3);
        for (const HugePage& page : again) EXPECT_EQ(first.count(page.data()), 1u);
        HugePage moved = std::move(again[0]);
        EXPECT_EQ(first.count(moved.data()), 1u);
        EXPECT_EQ(again[0].data(), nullptr);
        std::swap(again[1], again[2]);
    }
    std::vector<HugePage> many(100);  // more than are kept: the rest goes back to the system
    std::set<const std::byte*> distinct;
    for (const HugePage& page : many) distinct.insert(page.data());
    EXPECT_EQ(distinct.size(), many.size());
}

}  // namespace
}  // namespace lightloom
