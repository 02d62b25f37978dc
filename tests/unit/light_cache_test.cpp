// Where light sub-paths are kept: pages that several threads fill, the spare pages between units, and that a vertex that is kept
// gives what it gave when it was traced.

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <thread>

#include "common/transport/light_cache.h"
#include "tests/support/test_scenes.h"
#include "tests/unit/bsdf_cases.h"

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
        const LightVertex* y = cache.at(path.first_vertex);
        for (int i = 0; i < length(m); ++i) ASSERT_TRUE(y[i].fwd == m && y[i].rev == i) << m << " " << i;
        total += path.length;
        last = std::max(last, path.first_vertex);
    }
    // What a writer leaves of a page is filled by another.
    EXPECT_LT(double(last), 1.15 * double(total) + kThreads * double(HugePage::kBytes / sizeof(LightVertex)));
}

template <class T>
bool same_bits(const T& a, const T& b) {
    return std::memcmp(&a, &b, sizeof(T)) == 0;
}

/// Mutation: LightVertex::eval() with s and t of the frame exchanged fails this.
TEST(LightVertex, ScattersAsTheVertexThatWasTraced) {
    Rng rng({3});
    int scattered = 0;
    for (const testing::BsdfCase& c : testing::bsdf_cases()) {
        LightCache cache;
        LightCache::Writer writer(cache);
        for (int i = 0; i < 50; ++i) {
            PathVertex v;
            v.bsdf = c.bsdf;
            v.ng = testing::uniform_direction(&rng);
            v.shading = Frame(normalize(v.ng + testing::uniform_direction(&rng) * 0.1f));
            v.wo = testing::uniform_direction(&rng);
            v.wo_local = v.shading.to_local(v.wo);
            v.adjoint = std::fabs(v.wo_local.z) / abs_dot(v.ng, v.wo);
            const LightVertex& kept = *cache.at(writer.append(&v, 1).first_vertex);
            EXPECT_EQ(kept.kind, c.bsdf.kind);
            ASSERT_EQ(kept.smooth, c.bsdf.has_smooth_lobe()) << c.name;
            for (int d = 0; d < 20; ++d) {
                const Vec3 w = testing::uniform_direction(&rng);
                const Scatter a = scatter<TransportMode::kImportance>(v, w), b = scatter<TransportMode::kImportance>(kept, w);
                ASSERT_TRUE(same_bits(a.value, b.value)) << c.name;
                ASSERT_TRUE(!kept.smooth || (a.pdf_fwd == b.pdf_fwd && a.pdf_rev == b.pdf_rev)) << c.name;
                scattered += !b.value.is_black();
            }
        }
    }
    EXPECT_GT(scattered, 10000);
}

/// The first k entries.
template <class T>
bool same_bits(const T* a, const T* b, int k) {
    return std::memcmp(a, b, sizeof(T) * size_t(k)) == 0;
}

/// Contribution, densities and throughput. Mutation: a LightVertex that takes `survival` for 1 fails this.
TEST(LightVertex, ConnectsAsTheVertexThatWasTraced) {
    constexpr int kEdges = 7;
    constexpr ViewDetail kDetail = ViewDetail::kSubspace;
    const RouletteRule roulette{.first_vertex = 2};
    int connected = 0, longer = 0;
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        std::vector<PathVertex> y(kEdges + 1), z(kEdges + 2);
        LightCache cache;
        WalkCounters counters;
        for (uint32_t i = 0; i < 400; ++i) {
            LightSampler light({1, Stage::kLight, 0, i});
            const int n = trace_light_path(*scene, light, kEdges, roulette, y.data(), &counters);
            const LightCache::Path path = LightCache::Writer(cache).append(y.data(), n);
            // As a render has it: the cache is moved to where it stays.
            LightCache moved = std::move(cache);
            cache = std::move(moved);
            const auto connect_all = [&](int t) {
                if (!z[size_t(t - 1)].bsdf.has_smooth_lobe()) return;
                const LightVertex* kept = cache.at(path.first_vertex);
                for (int s = 1; s <= n && s + t - 1 <= kEdges; ++s) {
                    if (s > 1 && !y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                    PathView a, b;
                    const Rgb c = connect_candidate<kDetail>(*scene, y.data(), s, z.data(), t, &a, &counters);
                    ASSERT_TRUE(same_bits(c, connect_candidate<kDetail>(*scene, kept, s, z.data(), t, &b, &counters)));
                    if (c.is_black()) continue;
                    view_throughput(y.data(), s, z.data(), &a);
                    view_throughput(kept, s, z.data(), &b);
                    const int k = a.k;
                    ASSERT_EQ(k, b.k);
                    ASSERT_TRUE(same_bits(a.fwd, b.fwd, k) && same_bits(a.rev, b.rev, k) && same_bits(a.delta, b.delta, k));
                    ASSERT_TRUE(same_bits(a.light_throughput + 1, b.light_throughput + 1, k - 1));
                    ASSERT_EQ(a.next_event, b.next_event);
                    ++connected, longer += s > 2;
                }
            };
            CameraSampler camera(1, i, i);
            trace_camera_path(*scene, camera, int(i % 8), int(i / 8 % 8), kEdges, roulette, z.data(), &counters, connect_all,
                              [](int, const WalkRay&) {});
        }
    }
    EXPECT_GT(connected, 10000);
    EXPECT_GT(longer, 3000);
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
