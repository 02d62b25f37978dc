// What a camera vertex draws from a unit's cache: every prefix with the probability by which its contribution is divided, whatever
// the tables, the windows and the number of connections.

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "common/transport/spcbpt.h"
#include "tests/support/random_tables.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// Given the cache, the expected sum over the draws of scale / r is 1 / M_i for each of its prefixes, M_i the light sub-paths that
/// subspace i may reach into: with the estimator of common/path/README.md, "Subspaces", that makes it the mean over the cache.
TEST(Draws, AreScaledByTheirProbability) {
    const auto scene = testing::glossy();
    testing::RandomTableOptions random;
    random.max_window = 4;
    random.spread = 3;
    const SubspaceTables tables = testing::random_tables(scene->emitters(), 21, random);
    for (const ByDepth<int>& connections : {ByDepth<int>(1), ByDepth<int>(3), ByDepth<int>(2, 7)}) {
        constexpr uint64_t kPaths = 25;
        const auto prepared = std::make_shared<const PreparedTables>(tables);
        const SpcbptAlgorithm<> algorithm{
            {spcbpt_selection(prepared, {.connections = connections}), prepared, connections}, Heuristic::kBalance, kPaths};
        UnitPreparation preparation;
        RenderUnit work;
        work.iteration_count = 1, work.tile = scene->frame().crop, work.light_path_count = 1;
        const auto state = algorithm.prepare({*scene, 77, 6, {}, work, {}}, &preparation, AnyContribute{});
        // By place in the index: the prefix, and what one draw of it adds on average.
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> subspace_of;
        for (uint32_t i = 0; i < tables.light_count; ++i) {
            const auto& s = state.index.subspaces[i];
            for (uint32_t c = s.begin; c < s.begin + s.count; ++c) {
                const LightCandidate& p = state.index.candidates[c].prefix;
                subspace_of[{p.first_vertex, p.s}] = i;
            }
        }
        ASSERT_EQ(subspace_of.size(), state.index.candidates.size());
        ASSERT_GT(subspace_of.size(), 100u);
        for (const int t : {2, 3}) {
            const uint32_t eye = t == 2 ? 0 : tables.eye_count - 1;
            const int draws = connections(t);
            PathVertex v;
            v.label = uint16_t(eye);
            Rng rng({5, Stage::kTraining, eye, uint64_t(draws)});
            constexpr int kDraws = 400000;
            struct Sums {
                double sum = 0, square = 0;
            };
            std::map<const LightVertex*, std::map<int, Sums>> found;
            for (int d = 0; d < kDraws; ++d) {
                LightPick picks[kMaxConnections];
                const int count = algorithm.method.draw(
                    state.cache, state.index, v, t, [&] { return rng.uniform2(); }, rng, 6, picks);
                ASSERT_LE(count, draws);
                std::map<std::pair<const LightVertex*, int>, double> once;  // draws of one vertex are not independent
                for (int n = 0; n < count; ++n)
                    once[{picks[n].y, picks[n].s}] += double(algorithm.method.inverse_density(picks[n]));
                for (const auto& [prefix, value] : once) {
                    Sums& s = found[prefix.first][prefix.second];
                    s.sum += value, s.square += value * value;
                }
            }
            size_t tested = 0;
            double worst = 0;
            for (const auto& [place, i] : subspace_of) {
                const LightVertex* y = state.cache.at(place.first);
                const double paths = double(kPaths) * tables.window[i];
                const double r = double(scalar_of(y[place.second - 1].alpha));
                const double all = double(state.index.subspaces[i].scale(t)) * paths * draws;  // R_i
                if (kDraws * draws * double(tables.column(eye)[i]) * r / all < 400) continue;  // too rarely to be normal
                const Sums& s = found[y][int(place.second)];
                const double mean = s.sum / kDraws, error = std::sqrt((s.square / kDraws - mean * mean) / kDraws);
                ++tested;
                worst = std::max(worst, std::fabs(mean - 1 / paths) / error);
            }
            EXPECT_GT(tested, subspace_of.size() / 2) << draws << " connections, eye subspace " << eye;
            EXPECT_LT(worst, 4.7) << draws << " connections, eye subspace " << eye;  // 1e-3 over some hundred prefixes
        }
    }
}

}  // namespace
}  // namespace lightloom
