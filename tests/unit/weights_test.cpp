// The weight suites: on the very same path, the weights of all techniques sum to one, and every technique describes that path by
// the same PathView. Everything is rebuilt through production code, for every row of the catalog, whatever its tables hold.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/transport/bdpt.h"
#include "common/transport/lvcbpt.h"
#include "tests/support/path_generator.h"
#include "tests/support/stub_algorithms.h"
#include "tests/support/table_render.h"
#include "tests/support/tally.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::can_be_hit;
using testing::FullPath;
using testing::kLooseTraced;
using testing::MergeStubSelection;
using testing::Tally;

constexpr int kEdges = 7;

/// Weights under test. The members of a family read the same of a path, so that it is rebuilt once for all of them.
struct Member {
    std::string name;
    std::unique_ptr<PathWeights> weights;
    Heuristic heuristic = Heuristic::kBalance;
    Tally rebuilt{}, traced{};
};
using Family = std::vector<Member>;

/// A row with its defaults, with each value of each of its choices, and with few and many
/// connections and shadow rays, by depth or not; all with
/// the same tables. Empty where single paths cannot be asked about.
Family family_of(const AlgorithmInfo& row, const std::shared_ptr<const Scene>& scene, uint64_t seed) {
    const std::string name(row.name);
    auto parameters = testing::with_small_training(name, {});
    if (parameters.contains("cache")) parameters["cache"] = "50";
    if (parameters.contains("merge-radius")) parameters["merge-radius"] = "2";  // merges count for as much as the rest
    std::vector<std::pair<std::string, std::string>> changes{{"", ""}};
    // The first of a family completes the paths for all of them, and a row that may merge reads the most if it does.
    if (row.may_merge) {
        changes.insert(changes.begin(), {"merging", "on"});
        for (const char* radius : {"0.1", "2", "100"}) changes.emplace_back("merging=on merge-radius", radius);
    }
    for (const ParameterInfo& p : row.parameters) {
        for (const std::string_view choice : p.choices)
            if (choice != "merge") changes.emplace_back(p.name, choice);  // no path here is made by a merge, and hits alone are few
        if (p.name == "merge-radius") changes.insert(changes.end(), {{"merge-radius", "0.1"}, {"merge-radius", "100"}});
        if (p.name == "shadow-rays") changes.insert(changes.end(), {{"shadow-rays", "4"}, {"shadow-rays", "100"}});
        if (p.name == "connections") changes.insert(changes.end(), {{"connections", "1,4"}, {"connections", "5"}});
    }
    const Tables all_tables = testing::random_tables_for(row, *scene, seed);
    Family family;
    bool front_knows_all = false;  // the first member tells what all of them read of a path
    for (const auto& [parameter, value] : changes) {
        auto set = parameters;
        if (!parameter.empty()) set[parameter] = value;
        if (parameter.starts_with("merging=on ")) {
            set.erase(parameter);
            set["merging"] = "on";
            set["merge-radius"] = value;
        }
        const RenderSettings settings = testing::settings_of(name, set, seed);
        const Tables tables = settings.algorithm.learning() ? all_tables : Tables();
        const auto renderer = Renderer::create(scene, settings, tables);
        if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
        auto weights = (*renderer)->weights();
        if (!weights) return {};
        family.push_back({name + (parameter.empty() ? "" : ", " + parameter + "=" + value), std::move(weights),
                          settings.algorithm.has(kHeuristic.name) ? heuristic_of(settings.algorithm) : Heuristic::kBalance});
        if (!front_knows_all && !tables.empty()) std::swap(family.front(), family.back()), front_knows_all = true;
    }
    return family;
}

/// Methods to come, as stubs.
Family family_of_stubs(const Scene& scene) {
    const BdptSelection bdpt = testing::bdpt_selection(scene);
    const TypicalSurvival survival{RouletteRule{}};
    Family family;
    family.push_back({"merge stub", testing::weights_of(MergeStubSelection{bdpt})});
    family.push_back({"merge stub, power", testing::weights_of(MergeStubSelection{bdpt}, Heuristic::kPower), Heuristic::kPower});
    family.push_back({"pairing stub", testing::weights_of(testing::PairingStubSelection{bdpt})});
    for (const int rays : {0, 1, 5})
        family.push_back({std::to_string(rays) + " rays beside the cache",
                          testing::weights_of(UniformSelection{bdpt.light_paths_per_iteration, 0.37, survival, {rays, rays > 0}})});
    return family;
}

/// Adds what all techniques of a member together weigh, each as it would have seen the path had it made it, and the same with the
/// path's own technique as it did see it. Nothing for members that have no such technique.
void add_sums(const Scene& scene, const FullPath& path, Technique own, const PathView& traced, Family* family) {
    std::vector<std::pair<double, double>> sums(family->size());
    testing::for_each_technique(path.k(), [&](Technique t) {
        if (t.kind == TechniqueKind::kMerge ? traced.delta[t.s] : !can_connect(traced, t.s)) return;
        if (std::none_of(family->begin(), family->end(), [&](const Member& m) { return m.weights->sigma(traced, t) > 0; })) return;
        const auto other = testing::rebuild(scene, path, t, family->front().weights.get());
        if (!other) return;
        for (size_t i = 0; i < family->size(); ++i) {
            const PathWeights& weights = *(*family)[i].weights;
            if (!(weights.sigma(other->view, t) > 0)) continue;
            const double weight = weights.weight(other->view, t);
            sums[i].first += weight;
            sums[i].second += t == own ? weights.weight(traced, own) : weight;
        }
    });
    for (size_t i = 0; i < family->size(); ++i) {
        Member& m = (*family)[i];
        if (!(m.weights->sigma(traced, own) > 0)) continue;
        m.rebuilt.add(sums[i].first - 1, path);
        m.traced.add(sums[i].second - 1, path);
    }
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

/// With Russian roulette where a path was traced, without where it is rebuilt: weights do not know it.
/// With `lit`, light leaves by a random table, of which weights know no more than the densities that they see. Each seed has tables
/// and paths of its own.
void check_sums(const testing::NamedScene& named, bool lit, std::initializer_list<uint64_t> seeds) {
    const auto scene = named.make(), stage = named.stage(scene);
    const bool hits = can_be_hit(*scene);
    // A scene without lights that can be hit has far fewer paths to offer.
    const int count = (hits ? 4000 : 10000) * (lit ? 3 : 2) / 2;
    std::vector<int> made(kEdges + 1, 0);
    const auto check = [&](const auto& make) {
        Family all;
        for (const uint64_t seed : seeds) {
            Family family = make(seed);
            if (family.empty()) return;
            const auto traced = lit ? testing::randomly_lit(scene, seed) : scene;
            const auto rebuilt = lit ? testing::randomly_lit(stage, seed) : stage;
            testing::for_each_path(
                *traced, count, kEdges, 40 + seed,
                [&](const FullPath& path, Technique own, const PathView& view, const Rgb&) {
                    ++made[size_t(own.s)];
                    if (path.k() >= 2) add_sums(*rebuilt, path, own, view, &family);
                },
                family.front().weights.get());
            if (all.empty()) {
                all = std::move(family);
                continue;
            }
            for (size_t i = 0; i < all.size(); ++i) all[i].rebuilt += family[i].rebuilt, all[i].traced += family[i].traced;
        }
        for (const Member& m : all) {
            m.rebuilt.check(m.name, lit ? testing::kLooseLit : 2e-3, lit ? testing::kGrossLit : 2e-4);
            // Squares of densities deviate twice as much.
            if (m.heuristic == Heuristic::kBalance)
                m.traced.check(m.name + ", own view as traced", lit ? testing::kLooseLit : kLooseTraced,
                               lit ? testing::kGrossLit : 2e-4);
        }
    };
    for (const AlgorithmInfo* row : catalog()) check([&](uint64_t seed) { return family_of(*row, scene, seed); });
    check([&](uint64_t) { return family_of_stubs(*scene); });
    for (int s = hits ? 0 : 1; s <= 4; ++s) EXPECT_GT(made[size_t(s)], 20) << "technique s = " << s << " was hardly exercised";
}

TEST_P(Weights, SumToOneOverAllTechniques) { check_sums(GetParam(), false, {1, 2, 3}); }
TEST_P(Weights, SumToOneWithLearnedEmission) { check_sums(GetParam(), true, {3}); }

class WeightsNightly : public Weights {};
TEST_P(WeightsNightly, SumToOneWithLearnedEmission) { check_sums(GetParam(), true, {1, 2, 3}); }

void check_views(const testing::NamedScene& named, bool lit) {
    const auto unlit = named.make(), unlit_stage = named.stage(unlit);
    const auto scene = lit ? testing::randomly_lit(unlit, 3) : unlit;
    const auto stage = lit ? testing::randomly_lit(unlit_stage, 3) : unlit_stage;
    Tally densities, contributions;
    testing::for_each_path(*scene, 1500, 6, 12, [&](const FullPath& path, Technique own, const PathView&, const Rgb&) {
        const int k = path.k();
        if (k < 2) return;
        // f = contribution * density of the technique: in one measure, the same number for all of them.
        const auto f_of = [&](const PathView& v, const Rgb& c, Technique t) {
            const bool next_event = t.kind == TechniqueKind::kNextEvent, merge = t.kind == TechniqueKind::kMerge;
            double density = next_event ? v.next_event : merge ? v.fwd[t.s] : 1;
            for (int i = next_event ? 1 : 0; i < k; ++i) density *= i < t.s ? v.fwd[i] : v.rev[i];
            for (int i = std::max(t.s, 1); i < k; ++i)
                if (v.delta[i]) density *= refraction_measure(path, i);
            return density * scalar_of(c);
        };
        const auto mine = testing::rebuild(*stage, path, own);
        if (!mine) return;
        const double f = f_of(mine->view, mine->contribution, own);
        testing::for_each_technique(k, [&](Technique t) {
            const auto other = testing::rebuild(*stage, path, t);
            if (!other) return;
            EXPECT_EQ(other->view.k, k);
            for (int i = 0; i < k; ++i) {
                EXPECT_EQ(other->view.delta[i], path.x[size_t(i)].delta);
                densities.add(other->view.fwd[i] / mine->view.fwd[i] - 1, path);
                if (mine->view.rev[i] > 0) densities.add(other->view.rev[i] / mine->view.rev[i] - 1, path);
            }
            if (mine->view.next_event > 0) densities.add(other->view.next_event / mine->view.next_event - 1, path);
            contributions.add(f_of(other->view, other->contribution, t) / f - 1, path);
        });
    });
    densities.check("densities", lit ? testing::kLooseLit : 2e-3, lit ? testing::kGrossLit : 2e-4);
    contributions.check("path integrand", lit ? testing::kLooseLit : 2e-3, lit ? testing::kGrossLit : 2e-4);
}

TEST_P(Weights, EveryTechniqueSeesTheSamePath) { check_views(GetParam(), false); }
TEST_P(Weights, EveryTechniqueSeesTheSamePathWithLearnedEmission) { check_views(GetParam(), true); }

const auto scene_name = [](const ::testing::TestParamInfo<testing::NamedScene>& param) { return param.param.name; };
INSTANTIATE_TEST_SUITE_P(Scenes, Weights, ::testing::ValuesIn(testing::kScenes), scene_name);
INSTANTIATE_TEST_SUITE_P(Scenes, WeightsNightly, ::testing::ValuesIn(testing::kScenes), scene_name);

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

bool possible(const PathView& view, Technique t) {
    return t.kind == TechniqueKind::kMerge ? !view.delta[t.s] : can_connect(view, t.s);
}

TEST(WeightEvaluator, PartitionOfUnityOnSyntheticPaths) {
    for (uint64_t seed = 0; seed < 2000; ++seed) {
        const int k = 2 + int(seed % 9);
        const PathView view = synthetic_view(k, seed, 1);
        const MergeStubSelection selection{{4096}, 1000, 0.01};
        for (const Heuristic h : {Heuristic::kBalance, Heuristic::kPower, Heuristic::kMaximum}) {
            double sum = 0;
            testing::for_each_technique(k, [&](Technique t) {
                if (possible(view, t)) sum += mis_weight(view, t, selection.on(view), h);
            });
            EXPECT_NEAR(sum, 1, 1e-10) << "seed " << seed << " k " << k;
        }
    }
}

TEST(WeightEvaluator, EqualsExplicitProducts) {
    for (uint64_t seed = 0; seed < 500; ++seed) {
        const int k = 2 + int(seed % 7);
        const PathView view = synthetic_view(k, seed, 1);
        const MergeStubSelection selection{{1000}, 100, 0.1};
        const auto on = selection.on(view);
        std::vector<std::pair<Technique, double>> rho;
        double sum = 0;
        testing::for_each_technique(k, [&](Technique t) {
            double p = possible(view, t) ? sigma(on, t) : 0;
            if (t.kind == TechniqueKind::kMerge) p *= view.fwd[t.s];
            for (int i = 0; i < k; ++i) p *= i < t.s ? view.fwd[i] : view.rev[i];
            if (!(p > 0)) return;
            rho.emplace_back(t, p);
            sum += p;
        });
        for (const auto& [t, p] : rho) EXPECT_NEAR(mis_weight(view, t, on), p / sum, 1e-12) << to_string(t.kind) << ' ' << t.s;
    }
}

/// Two vertices in the same place have an infinite density; the evaluator once never came back from one.
TEST(WeightEvaluator, InfiniteDensitiesEnd) {
    WideProduct product;
    product.multiply(HUGE_VAL);
    EXPECT_EQ(product.value(0.5), HUGE_VAL);
    product.multiply(0.5);
    EXPECT_EQ(product.value(1), HUGE_VAL);
}

/// Depth 64 and scenes scaled by 1e-4 and 1e4: whole-path products would leave the range of double.
TEST(WeightEvaluator, LongPathsAndScaledScenesKeepTheirWeights) {
    for (uint64_t seed = 0; seed < 50; ++seed) {
        const int k = 64;
        const BdptSelection selection{1};
        const PathView base = synthetic_view(k, seed, 1);
        for (const double scale : {1e-4, 1e4}) {
            const PathView scaled = synthetic_view(k, seed, scale);
            double sum = 0;
            testing::for_each_technique(k, [&](Technique t) {
                if (!possible(base, t) || !(sigma(selection.on(base), t) > 0)) return;
                const double a = mis_weight(base, t, selection.on(base)), b = mis_weight(scaled, t, selection.on(scaled));
                EXPECT_NEAR(a, b, 1e-9);
                sum += b;
            });
            EXPECT_NEAR(sum, 1, 1e-9);
        }
    }
}

}  // namespace
}  // namespace lightloom
