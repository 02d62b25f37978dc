// The heuristics of the weights, name by name: their shares are what they say, weights sum to one whatever densities, radii and
// photons there are and whichever techniques are left out, and images depend neither on threads nor, in the mean, on the name.

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "common/path/mask.h"
#include "common/tables/density_part.h"
#include "common/transport/lvcbpt.h"
#include "common/transport/vcm.h"
#include "tests/support/path_rebuild.h"
#include "tests/support/row_render.h"
#include "tests/support/small_scenes.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::Parameters;

constexpr Correction kCorrections[] = {Correction::kUncorrected, Correction::kOne,     Correction::kCorrelation,
                                       Correction::kFootprint,   Correction::kPhotons, Correction::kPhotonsBalanced};
constexpr Heuristic kHeuristics[] = {Heuristic::kBalance, Heuristic::kPower, Heuristic::kMaximum};

PathView random_view(int k, uint64_t seed) {
    Rng rng({seed, Stage::kTraining, 0, 5});
    const auto wide = [&](double octaves) { return std::exp2((rng.uniform_double() - 0.5) * 2 * octaves); };
    PathView view;
    view.k = k;
    for (int i = 0; i < k; ++i) {
        view.fwd[i] = wide(20), view.rev[i] = wide(20);
        // Many vertices of diffuse scenes are as likely from either side.
        if (i > 0 && rng.uniform() < 0.3f) view.rev[i] = view.fwd[i];
        view.delta[i] = i > 0 && rng.uniform() < 0.2f;
        view.lossless[i] = false;
        view.photons[i] = rng.uniform() < 0.2f ? 0 : float(wide(15));
        view.edge[i] = float(wide(3));
    }
    view.source = PathView::Source(rng.below(3));
    view.discrete_source = view.source == PathView::Source::kDiscrete;
    if (view.source == PathView::Source::kDirection) view.edge[0] = 0;
    view.next_event = wide(10);
    view.primary_distance2 = wide(4), view.footprint_distance2 = wide(4);
    return view;
}

template <class Selection>
double sum_of_weights(const PathView& view, const Selection& selection, Heuristic heuristic) {
    double sum = 0;
    testing::for_each_technique(view.k, [&](Technique t) {
        if (t.kind == TechniqueKind::kMerge ? view.delta[t.s] : !can_connect(view, t.s)) return;
        sum += mis_weight(view, t, selection.on(view), heuristic);
    });
    return sum;
}

/// Calls check(selection, name) for every kind of selection that a correction may stand in.
template <class Check>
void for_each_selection(uint64_t seed, Check&& check) {
    Rng rng({seed, Stage::kTraining, 1, 5});
    const BdptSelection bdpt{1 + 1e5 * rng.uniform_double(), {int(1 + rng.below(30)), int(1 + rng.below(3))}};
    const ByDepth<double> connections(1 + rng.below(9), 1 + rng.below(9));
    const UniformSelection uniform{bdpt.light_paths_per_iteration, connections.each([](double n) { return n / 2.3; }),
                                   TypicalSurvival(RouletteRule{}), bdpt.rays, connections};
    const MergeRadius radius{.per_distance2 = std::exp2(-20 * rng.uniform_double()), .most2 = 1e3};
    for (const Correction correction : kCorrections) {
        check(VcmSelection{{bdpt}, radius, MergeKernel(rng.below(2)), rng.below(2) != 0, correction}, "vcm");
        check(Corrected<BdptSelection>{bdpt, correction}, "bdpt");
        check(Corrected<UniformSelection>{uniform, correction}, "lvcbpt");
    }
}

TEST(Heuristics, WeightsSumToOneWhateverThePathAndTheRadius) {
    for (uint64_t seed = 0; seed < 1500; ++seed) {
        const PathView view = random_view(2 + int(seed % 9), seed);
        for_each_selection(seed, [&](const auto& selection, const char* name) {
            for (const Heuristic h : kHeuristics)
                EXPECT_NEAR(sum_of_weights(view, selection, h), 1, 1e-10) << name << ", seed " << seed << ", heuristic " << int(h);
        });
    }
}

TEST(Heuristics, WeightsOfTheTechniquesThatRemainSumToOne) {
    for (uint64_t seed = 0; seed < 300; ++seed) {
        const PathView view = random_view(2 + int(seed % 9), seed);
        for (int kind = 0; kind < kTechniqueKinds; ++kind) {
            const TechniqueMask mask = TechniqueMask::without(TechniqueKind(kind));
            for_each_selection(seed, [&](const auto& selection, const char* name) {
                const Masked<std::remove_cvref_t<decltype(selection)>> masked{selection, mask};
                const double sum = sum_of_weights(view, masked, Heuristic::kBalance);
                // Between Dirac vertices nothing may be left.
                if (sum != 0) {
                    EXPECT_NEAR(sum, 1, 1e-10) << name << ", seed " << seed << ", without kind " << kind;
                }
            });
        }
    }
}

TEST(Heuristics, SharesLieWhereTheySay) {
    for (uint64_t seed = 0; seed < 2000; ++seed) {
        const PathView view = random_view(3 + int(seed % 8), seed);
        const MergeRule rule{std::exp2(double(seed % 21)), std::exp2(-double(seed % 17)), view.k - 2};
        const MergeShares correlation = MergeShares::correlation(view, rule), footprints = MergeShares::footprints(view, rule);
        const MergeShares plus = MergeShares::photons(view, rule, false), star = MergeShares::photons(view, rule, true);
        double sum = 0;
        int count = 0;
        for (int i = 1; i <= rule.last; ++i) {
            for (const MergeShares* shares : {&correlation, &footprints, &plus}) {
                EXPECT_GE((*shares)(i), (1 - 1e-12) / rule.paths);
                EXPECT_LE((*shares)(i), 1 + 1e-12);
            }
            EXPECT_DOUBLE_EQ(plus(i), 1 / std::clamp(rule.paths * rule.disc * double(view.photons[i]), 1.0, rule.paths));
            if (view.delta[i]) continue;
            sum += star(i), ++count;
            EXPECT_NEAR(star(i) / plus(i), star(1) / plus(1), 1e-9 * star(1) / plus(1)) << "equation 7 only scales equation 6";
        }
        if (count > 0) {
            EXPECT_NEAR(sum / count, 1, 1e-9) << "merges of a path count as uncorrected in total";
        }
    }
}

/// Wide camera sub-paths that merge with narrow light sub-paths find what they share over and over; the other way round they do
/// not.
TEST(Heuristics, FootprintsTellWhichSubPathIsThePoorOne) {
    PathView view = random_view(4, 1);
    std::fill_n(view.delta, view.k, false);
    std::fill_n(view.edge, view.k, 1.0f);
    view.source = PathView::Source::kArea;
    const auto share = [&](double camera, double light) {
        std::fill_n(view.rev, view.k, camera);
        std::fill_n(view.fwd, view.k, light);
        return MergeShares::footprints(view, {1e4, 1e-4, 2})(1);
    };
    EXPECT_NEAR(share(1e-4, 1e4), 1e-4, 1e-6);
    EXPECT_NEAR(share(1e4, 1e-4), 1, 1e-3);
    EXPECT_LT(share(1, 1), 0.01) << "the camera's has two edges, the light's a single one";
    // The camera's three edges of length 1 open by another 1 each and add 1, 2 and 3; the lamp is 1 wide and its edge adds 1.
    std::fill_n(view.rev, view.k, 1.0);
    std::fill_n(view.fwd, view.k, 1.0);
    const double a = (1 + 2 + 3) * (1 + 2 + 3) / 4.0;
    EXPECT_NEAR(share(1, 1), (1 + a * a) / (1 + 1e4 * a * a), 1e-12);
}

Partial render(const std::shared_ptr<const Scene>& scene, const std::string& algorithm, Parameters parameters, uint32_t iterations,
               int threads = 0, const TechniqueMask* mask = nullptr) {
    const RenderSettings settings =
        testing::settings_of(algorithm, testing::with_small_training(algorithm, std::move(parameters)), 7);
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    return arena.execute([&] {
        const auto renderer = create_with_tables(scene, settings, {}, mask);
        if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
        Result<Partial> partial = (*renderer)->render(testing::whole_frame(*scene, settings.algorithm, iterations), {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        EXPECT_EQ(partial->dropped_count, 0u);
        return *std::move(partial);
    });
}

std::vector<std::string> heuristics_of(const std::string& algorithm) { return testing::heuristics_of(**find_algorithm(algorithm)); }

/// One light sub-path for each camera sub-path and one shadow ray: no two samples share anything.
TEST(Heuristics, WhereNothingIsSharedAllAreBalanceBitForBit) {
    const auto scene = testing::glass_and_mirror();
    const Partial balance = render(scene, "bdpt", {{"heuristic", "balance"}}, 2);
    for (const char* name : {"popov", "correlation-aware"})
        testing::expect_identical(render(scene, "bdpt", {{"heuristic", name}}, 2), balance, name);
}

TEST(Heuristics, BytesDoNotDependOnThreads) {
    const auto scene = testing::glossy();
    for (const std::string algorithm : {"bdpt", "lvcbpt", "spcbpt", "vcm"})
        for (const std::string& name : heuristics_of(algorithm)) {
            const Parameters parameters{{"heuristic", name}, {"next-event", "3"}};
            testing::expect_identical(render(scene, algorithm, parameters, 1, 1), render(scene, algorithm, parameters, 1, 4),
                                      algorithm + ", " + name);
        }
}

/// With rows as tiles and one iteration, camera samples and their light sub-paths are those of the frame.
TEST(Heuristics, SamplesDoNotDependOnTiles) {
    const auto scene = testing::glossy();
    const Rect crop = scene->frame().crop;
    for (const std::string& name : heuristics_of("bdpt")) {
        const RenderSettings settings = testing::settings_of("bdpt", {{"heuristic", name}, {"next-event", "3"}}, 7);
        const auto renderer = Renderer::create(scene, settings);
        ASSERT_TRUE(renderer.ok()) << renderer.status().message();
        const auto whole = (*renderer)->render(testing::whole_frame(*scene, settings.algorithm, 1), {});
        ASSERT_TRUE(whole.ok());
        for (int y0 = 0; y0 < crop.height(); y0 += 5) {
            const Rect rows{0, y0, crop.width(), std::min(y0 + 5, crop.height())};
            const uint64_t first = uint64_t(y0) * uint64_t(crop.width());
            const auto part = (*renderer)->render({0, 1, 0, rows, first, uint64_t(rows.area())}, {});
            ASSERT_TRUE(part.ok());
            EXPECT_EQ(std::memcmp(part->camera.data(), &whole->camera[3 * first], part->camera.size() * sizeof(double)), 0) << name;
        }
    }
}

/// Weights decide how noisy an image is and not how bright, and those of the techniques that remain make up for one that is left
/// out.
TEST(Heuristics, MeansDependNeitherOnTheNameNorOnTheTechniques) {
    const auto scene = testing::diffuse_box();
    const auto mean_of = [&](const std::string& name, const TechniqueMask& mask) {
        double sum = 0;
        const Partial image = render(scene, "vcm", {{"heuristic", name}, {"merge-radius", "0.3"}}, 24, 0, &mask);
        for (const double v : testing::develop(image, scene->frame().crop)) sum += v;
        return sum;
    };
    const double expected = mean_of("balance", {});
    for (const std::string& name : heuristics_of("vcm")) {
        EXPECT_NEAR(mean_of(name, {}) / expected, 1, 0.02) << name;
        for (const TechniqueKind kind : {TechniqueKind::kConnect, TechniqueKind::kLens, TechniqueKind::kMerge})
            EXPECT_NEAR(mean_of(name, TechniqueMask::without(kind)) / expected, 1, 0.02) << name << " without " << to_string(kind);
    }
}

TEST(Heuristics, TheDensityMapIsLearnedWhereItIsAskedForAndForAnyNumberOfThreads) {
    const auto scene = testing::diffuse_box();
    EXPECT_EQ(testing::settings_of("vcm").algorithm.learning(), nullptr);
    for (const char* name : {"vcm+", "vcm*"}) {
        const RenderSettings settings = testing::settings_of("vcm", {{"heuristic", name}, {"training-paths", "3000"}});
        ASSERT_NE(settings.algorithm.learning(), nullptr);
        std::string bytes;
        for (const int threads : {1, 3}) {
            tbb::task_arena arena(threads);
            arena.execute([&] {
                TrainingReport report;
                const auto tables = make_tables(*scene, settings, {}, &report);
                ASSERT_TRUE(tables.ok()) << tables.status().message();
                ASSERT_NE(density_of(*tables), nullptr);
                EXPECT_TRUE(bytes.empty() || bytes == serialize(*tables));
                bytes = serialize(*tables);
            });
        }
    }
}

}  // namespace
}  // namespace lightloom
