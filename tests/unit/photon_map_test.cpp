// The photon map finds what a search through all photons finds, whatever the radius and however many photons lie in one place, and
// always in the same order.

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "common/transport/photon_map.h"

namespace lightloom {
namespace {

using Place = std::pair<uint32_t, uint32_t>;  ///< Number of a path, and s.

/// Paths of up to six vertices in a box, or on one line, or all in one place; the smooth flag is that of a diffuse surface or of a
/// mirror.
LightCache scattered(int count, uint64_t seed, const Vec3& size) {
    LightCache cache;
    cache.paths.resize(size_t(count));
    LightCache::Writer writer(cache);
    Rng rng({seed, Stage::kTraining, 0, 0});
    for (LightCache::Path& path : cache.paths) {
        std::vector<PathVertex> y(rng.below(7));
        for (PathVertex& v : y) {
            v.p = {rng.uniform() * size.x, rng.uniform() * size.y, rng.uniform() * size.z};
            v.bsdf = rng.uniform() < 0.8f ? make_diffuse(Rgb(0.5f)) : Bsdf();
        }
        path = writer.append(y.data(), int(y.size()));
    }
    return cache;
}

std::vector<Place> found(const PhotonMap& map, const LightCache& cache, const Vec3& p, float radius) {
    std::vector<Place> places;
    map.for_each_near(p, radius * radius, [&](const PhotonMap::Photon& end, float distance2) {
        const auto path = std::find_if(cache.paths.begin(), cache.paths.end(), [&](const LightCache::Path& candidate) {
            return candidate.length > 0 && candidate.first_vertex == end.first_vertex;
        });
        EXPECT_EQ(distance2, length_squared(cache.at(end.first_vertex)[end.s - 1].p - p));
        places.emplace_back(uint32_t(path - cache.paths.begin()), end.s);
    });
    return places;
}

std::vector<Place> searched(const LightCache& cache, const Vec3& p, float radius) {
    std::vector<Place> places;
    for (uint32_t m = 0; m < cache.paths.size(); ++m)
        for (uint32_t s = 2; s <= cache.paths[m].length; ++s) {
            const LightVertex& v = cache.at(cache.paths[m].first_vertex)[s - 1];
            if (v.smooth && length_squared(v.p - p) < radius * radius) places.emplace_back(m, s);
        }
    return places;
}

/// Mutations: the far half visited only where the near one lies below, or y_0 taken for a photon, fail this.
TEST(PhotonMap, FindsWhatASearchFinds) {
    size_t total = 0;
    for (const Vec3& size : {Vec3{1, 1, 1}, Vec3{1, 0, 0}, Vec3{0, 0, 0}, Vec3{1e-3f, 1e3f, 1}})
        for (const int paths : {0, 1, 3, 10, 400}) {
            const LightCache cache = scattered(paths, uint64_t(paths), size);
            const PhotonMap map(cache);
            EXPECT_EQ(map.size(), searched(cache, {}, HUGE_VALF).size());
            Rng rng({9, Stage::kTraining, 0, 0});
            for (const float radius : {1e-3f, 0.05f, 0.3f, 2e3f})
                for (int i = 0; i < 20; ++i) {
                    const Vec3 p{rng.uniform() * size.x, rng.uniform() * size.y, rng.uniform() * size.z};
                    auto places = found(map, cache, p, radius);
                    total += places.size();
                    std::sort(places.begin(), places.end());
                    EXPECT_EQ(places, searched(cache, p, radius)) << paths << " paths, radius " << radius;
                }
        }
    EXPECT_GT(total, 10000u);
}

/// Threads write the cache's pages in any order, so that addresses differ; what is found, and in which order, does not.
TEST(PhotonMap, TheOrderDependsOnThePhotonsAlone) {
    const LightCache cache = scattered(20000, 3, {1, 1, 1});
    LightCache other;  // the same paths, the last one first in memory
    other.paths.resize(cache.paths.size());
    {
        LightCache::Writer writer(other);
        for (size_t m = cache.paths.size(); m-- > 0;) {
            const LightCache::Path& path = cache.paths[m];
            std::vector<PathVertex> y(path.length);
            for (uint32_t i = 0; i < path.length; ++i) {
                const LightVertex& v = cache.at(path.first_vertex)[i];
                y[i].p = v.p;
                y[i].bsdf = v.smooth ? make_diffuse(Rgb(0.5f)) : Bsdf();
            }
            other.paths[m] = writer.append(y.data(), int(y.size()));
        }
    }
    PhotonMap one, many;
    tbb::task_arena(1).execute([&] { one = PhotonMap(cache); });
    tbb::task_arena(4).execute([&] { many = PhotonMap(other); });
    EXPECT_GT(one.size(), 30000u);
    for (int i = 0; i < 20; ++i) {
        const Vec3 p{float(i) / 20, 0.5f, 0.3f};
        EXPECT_EQ(found(one, cache, p, 0.05f), found(many, other, p, 0.05f));
    }
}

}  // namespace
}  // namespace lightloom
