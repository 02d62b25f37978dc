// The weight suites: on the very same path, the weights of all techniques sum to one, and every
// technique describes that path by the same PathView. Everything is rebuilt through production
// code.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/transport/bdpt.h"
#include "common/transport/light.h"
#include "common/transport/path.h"
#include "tests/support/path_generator.h"
#include "tests/support/stub_algorithms.h"
#include "tests/support/tally.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::FullPath;
using testing::MergeStubSelection;
using testing::PairingStubSelection;
using testing::Tally;

/// Sum of the weights of all techniques that can make `path`, each from its own rebuilt view.
template <class Selection>
double weight_sum(const Scene& scene, const FullPath& path, const Selection& selection, Heuristic heuristic) {
    double sum = 0;
    const int k = path.k();
    std::optional<testing::Rebuilt> any;
    for (int s = selection.s_min(k); s <= selection.s_max(k); ++s) {
        const auto r = testing::rebuild(scene, path, s);
        if (!r) continue;
        sum += mis_weight(r->view, {TechniqueKind::kConnect, s}, selection, heuristic);
        any = r;
    }
    if constexpr (Selection::kMerges) {
        for (int i = 1; any && i < k; ++i)
            if (!any->view.delta[i]) sum += mis_weight(any->view, {TechniqueKind::kMerge, i}, selection, heuristic);
    }
    return sum;
}

/// What turns the density of a camera sub-path, crossing the Dirac vertex x_i of a path, into the measure of a light sub-path that
/// crosses it the other way. The density of the vertex behind a Dirac event is its probability times the geometry of the edge,
/// without the spreading of the ray, and refraction spreads by the squared index ratio and the ratio of the cosines. (Weights know
/// neither: they still sum to one, and are the balance heuristic's up to that factor.)
double refraction_measure(const FullPath& path, int i) {
    const PathVertex& v = path.x[size_t(i)];
    const bool sky = path.infinite && i == 1;
    const Vec3 to_light = sky ? -path.x[0].ng : normalize(path.x[size_t(i - 1)].p - v.p);
    const Vec3 to_camera = normalize((i + 1 < path.k() ? path.x[size_t(i + 1)].p : path.lens) - v.p);
    const double light = dot(v.shading.n, to_light), camera = dot(v.shading.n, to_camera), index = v.bsdf.eta;
    if (v.bsdf.kind != BsdfKind::kDielectric || light * camera > 0) return 1;
    return std::fabs(light / camera) * (camera > 0 ? index * index : 1 / (index * index));
}

class Weights : public ::testing::TestWithParam<testing::NamedScene> {};

TEST_P(Weights, SumToOneOverAllTechniques) {
    const auto scene = GetParam().make(), stage = GetParam().stage(scene);
    BdptSelection bdpt;
    bdpt.light_paths_per_iteration = double(scene->frame().crop.area());
    const MergeStubSelection merging{bdpt};
    const PairingStubSelection pairing{bdpt};
    Tally tallies[6];
    std::vector<int> made(16, 0);
    const auto& emitters = scene->emitters().all();
    const bool hits = std::any_of(emitters.begin(), emitters.end(), [](const Emitter& e) { return !e.is_delta(); });
    // A scene without lights that can be hit has far fewer paths to offer.
    testing::for_each_path(*scene, hits ? 10000 : 30000, 7, 11, [&](const FullPath& path, int s, const PathView&, const Rgb&) {
        ++made[size_t(s)];
        if (path.k() < 2) return;
        tallies[0].add(weight_sum(*stage, path, bdpt, Heuristic::kBalance) - 1, path);
        tallies[1].add(weight_sum(*stage, path, bdpt, Heuristic::kPower) - 1, path);
        tallies[2].add(weight_sum(*stage, path, merging, Heuristic::kBalance) - 1, path);
        tallies[3].add(weight_sum(*stage, path, pairing, Heuristic::kBalance) - 1, path);
        if (s <= 1) tallies[4].add(weight_sum(*stage, path, PathSelection{}, Heuristic::kBalance) - 1, path);
        if (s == path.k()) tallies[5].add(weight_sum(*stage, path, LightSelection{}, Heuristic::kBalance) - 1, path);
    });
    const char* names[] = {"bdpt balance", "bdpt power", "merge stub", "pairing stub", "path", "light"};
    for (int i = 0; i < 6; ++i) tallies[i].check(names[i]);
    for (int s = hits ? 0 : 1; s <= 4; ++s) EXPECT_GT(made[size_t(s)], 20) << "technique s = " << s << " was hardly exercised";
}

TEST_P(Weights, EveryTechniqueSeesTheSamePath) {
    const auto scene = GetParam().make(), stage = GetParam().stage(scene);
    Tally densities, contributions;
    testing::for_each_path(*scene, 1500, 6, 12, [&](const FullPath& path, int own, const PathView&, const Rgb&) {
        const int k = path.k();
        if (k < 2) return;
        // f = contribution * density of the technique: in one measure, the same number for all of them.
        const auto f_of = [&](const PathView& v, const Rgb& c, int s) {
            double density = s == 1 ? v.next_event : 1;
            for (int i = 0; i < k; ++i)
                if (!(s == 1 && i == 0)) density *= i < s ? v.fwd[i] : v.rev[i];
            for (int i = std::max(s, 1); i < k; ++i)
                if (v.delta[i]) density *= refraction_measure(path, i);
            return density * scalar_of(c);
        };
        const auto mine = testing::rebuild(*stage, path, own);
        if (!mine) return;
        const double f = f_of(mine->view, mine->contribution, own);
        for (int s = 0; s <= k; ++s) {
            const auto other = testing::rebuild(*stage, path, s);
            if (!other) continue;
            EXPECT_EQ(other->view.k, k);
            for (int i = 0; i < k; ++i) {
                EXPECT_EQ(other->view.delta[i], path.x[size_t(i)].delta);
                densities.add(other->view.fwd[i] / mine->view.fwd[i] - 1, path);
                if (mine->view.rev[i] > 0) densities.add(other->view.rev[i] / mine->view.rev[i] - 1, path);
            }
            densities.add(other->view.next_event / mine->view.next_event - 1, path);
            contributions.add(f_of(other->view, other->contribution, s) / f - 1, path);
        }
    });
    densities.check("densities");
    contributions.check("path integrand");
}

INSTANTIATE_TEST_SUITE_P(Scenes, Weights, ::testing::ValuesIn(testing::kScenes),
                         [](const ::testing::TestParamInfo<testing::NamedScene>& param) { return param.param.name; });

// Synthetic views: no geometry, exact double densities.

PathView synthetic_view(int k, uint64_t seed, double scale) {
    Rng rng({seed, Stage::kTraining, 0, 0});
    PathView view;
    view.k = k;
    // Area densities scale with 1 / length^2.
    const auto density = [&] { return std::exp((rng.uniform_double() - 0.5) * 24) / (scale * scale); };
    for (int i = 0; i < k; ++i) {
        view.fwd[i] = density();
        view.rev[i] = density();
        view.delta[i] = i > 0 && rng.uniform() < 0.2f;
    }
    view.delta[0] = false;
    view.next_event = density();
    return view;
}

TEST(WeightEvaluator, PartitionOfUnityOnSyntheticPaths) {
    for (uint64_t seed = 0; seed < 2000; ++seed) {
        const int k = 2 + int(seed % 9);
        const PathView view = synthetic_view(k, seed, 1);
        const MergeStubSelection selection{{4096}, 1000, 0.01};
        for (const Heuristic h : {Heuristic::kBalance, Heuristic::kPower, Heuristic::kMaximum}) {
            double sum = 0;
            for (int s = 0; s <= k; ++s) {
                const bool blocked = (s > 0 && view.delta[s - 1]) || (s > 0 && s < k && view.delta[s]);
                if (!blocked) sum += mis_weight(view, {TechniqueKind::kConnect, s}, selection, h);
            }
            for (int i = 1; i < k; ++i)
                if (!view.delta[i]) sum += mis_weight(view, {TechniqueKind::kMerge, i}, selection, h);
            EXPECT_NEAR(sum, 1, 1e-10) << "seed " << seed << " k " << k;
        }
    }
}

TEST(WeightEvaluator, EqualsExplicitProducts) {
    for (uint64_t seed = 0; seed < 500; ++seed) {
        const int k = 2 + int(seed % 7);
        const PathView view = synthetic_view(k, seed, 1);
        const BdptSelection selection{1000};
        std::vector<double> rho(size_t(k) + 1, 0);
        double sum = 0;
        for (int s = 0; s <= k; ++s) {
            if ((s > 0 && view.delta[s - 1]) || (s > 0 && s < k && view.delta[s])) continue;
            double p = selection.connect_factor(view, s);
            for (int i = 0; i < k; ++i) p *= i < s ? view.fwd[i] : view.rev[i];
            sum += rho[size_t(s)] = p;
        }
        for (int s = 0; s <= k; ++s)
            if (rho[size_t(s)] > 0) {
                EXPECT_NEAR(mis_weight(view, {TechniqueKind::kConnect, s}, selection), rho[size_t(s)] / sum, 1e-12);
            }
    }
}

/// Depth 64 and scenes scaled by 1e-4 and 1e4: whole-path products would leave the range of double.
/// Two vertices in the same place have an infinite density; the evaluator once never came back from one.
TEST(WeightEvaluator, InfiniteDensitiesEnd) {
    WideProduct product;
    product.multiply(HUGE_VAL);
    EXPECT_EQ(product.value(0.5), HUGE_VAL);
    product.multiply(0.5);
    EXPECT_EQ(product.value(1), HUGE_VAL);
}

TEST(WeightEvaluator, LongPathsAndScaledScenesKeepTheirWeights) {
    for (uint64_t seed = 0; seed < 50; ++seed) {
        const int k = 64;
        const BdptSelection selection{1};
        const PathView base = synthetic_view(k, seed, 1);
        for (const double scale : {1e-4, 1e4}) {
            const PathView scaled = synthetic_view(k, seed, scale);
            double sum = 0;
            for (int s = 0; s <= k; ++s) {
                if ((s > 0 && base.delta[s - 1]) || (s > 0 && s < k && base.delta[s])) continue;
                const double a = mis_weight(base, {TechniqueKind::kConnect, s}, selection);
                const double b = mis_weight(scaled, {TechniqueKind::kConnect, s}, selection);
                EXPECT_NEAR(a, b, 1e-9);
                sum += b;
            }
            EXPECT_NEAR(sum, 1, 1e-9);
        }
    }
}

}  // namespace
}  // namespace lightloom
