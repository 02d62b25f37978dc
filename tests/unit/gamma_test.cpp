// The trainers of Gamma. The implementation is included, not linked: the gradient and the single step of majorise-minimise are
// its own, and are what must be right.

#include "common/tables/train_gamma.cpp"

#include <gtest/gtest.h>

#include <string>

namespace lightloom {
namespace {

double normal_deviate(Rng& rng) {
    const double radius = std::sqrt(-2 * std::log(1 - rng.uniform_double()));
    return radius * std::cos(2 * kPiD * rng.uniform_double());
}

/// Heavy-tailed affinities without structure between `size` light and `size` eye subspaces: paths of one to three connections
/// that light tracing in proportion to Q and a uniform choice of eye subspaces generate. [common/path/README.md, "Trainer"]
struct Problem {
    uint32_t size;
    std::vector<double> affinity, energy, cumulative;

    Problem(uint32_t n, uint64_t seed) : size(n) {
        Rng rng({seed, Stage::kTraining, 0, 0});
        for (uint32_t c = 0; c < n * n; ++c) affinity.push_back(std::exp(1.6 * normal_deviate(rng)));
        double sum = 0;
        for (uint32_t i = 0; i < n; ++i) {
            energy.push_back(std::exp(normal_deviate(rng)));
            cumulative.push_back(sum += energy.back());
        }
    }
    uint32_t light(Rng& rng) const {
        const double u = rng.uniform_double() * cumulative.back();
        return uint32_t(std::upper_bound(cumulative.begin(), cumulative.end() - 1, u) - cumulative.begin());
    }
    GammaDataset draw(size_t paths, uint64_t seed) const {
        Rng rng({seed, Stage::kTraining, 1, 0});
        GammaDataset d;
        d.light_count = d.eye_count = size;
        d.source_count = size / 8;
        for (const double e : energy) d.energy.push_back(float(e));
        for (size_t x = 0; x < paths; ++x) {
            GammaPath p;
            p.first_node = uint32_t(d.nodes.size());
            p.node_count = 1 + rng.below(3);
            p.fixed = float(0.02 * rng.uniform_double());
            double value = 0;
            for (uint32_t n = 0; n < p.node_count; ++n) {
                const uint32_t i = light(rng), j = rng.below(size);
                const double share = n == 0 ? 1 : 0.3 * rng.uniform_double();  // of the other connections' densities
                d.nodes.push_back({uint16_t(i), uint16_t(j), float(share * cumulative.back() / energy[i])});
                if (n == 0) value = affinity[size_t(j) * size + i] * std::exp(0.7 * normal_deviate(rng));
            }
            p.weight = float(value * value);
            p.contribution = float(value);
            p.sample = uint32_t(x);
            d.paths.push_back(p);
        }
        return d;
    }
};

std::vector<uint32_t> all_of(const GammaDataset& d) {
    std::vector<uint32_t> paths(d.paths.size());
    std::iota(paths.begin(), paths.end(), 0u);
    return paths;
}

TEST(Gamma, GradientEqualsFiniteDifferences) {
    const GammaDataset data = Problem(10, 1).draw(2000, 2);
    for (const double mix : {0.0, 0.1, 0.5}) {
        const LevelProblem problem(data, 0, mix);
        const std::vector<uint32_t> paths = all_of(data);
        std::vector<float> b = problem.flat_prior();
        std::vector<double> gradient(b.size());
        problem.improve(&b, b, 0.3, paths, &gradient);  // away from the start
        problem.gradient(b, paths.data(), paths.data() + paths.size(), &gradient);
        double largest = 0;
        for (const double g : gradient) largest = std::max(largest, g);
        int compared = 0;
        for (size_t c = 0; c < b.size(); ++c) {
            std::vector<float> up = b, down = b;
            const float h = 0.02f * b[c];
            up[c] += h, down[c] -= h;
            const double slope = (problem.loss(up, paths) - problem.loss(down, paths)) / (double(up[c]) - double(down[c]));
            const double expected = -gradient[c] / double(paths.size());
            if (std::fabs(expected) < 1e-3 * largest / double(paths.size())) continue;
            EXPECT_NEAR(slope, expected, 5e-3 * std::fabs(expected)) << "mix " << mix << ", cell " << c;
            ++compared;
        }
        EXPECT_GT(compared, 60);
    }
}

/// Without a prior the step is a majorisation: the training loss never rises [common/path/README.md, "Trainer"].
TEST(Gamma, StepsWithoutPriorNeverRaiseTheLoss) {
    for (const size_t paths : {size_t(300), size_t(20000)}) {
        const GammaDataset data = Problem(16, 3).draw(paths, 4);
        for (const uint32_t bits : {0u, 2u}) {
            const LevelProblem problem(data, bits, 0.1);
            std::vector<float> b = problem.flat_prior();
            const std::vector<float> prior = b;
            const std::vector<uint32_t> all = all_of(data);
            std::vector<double> room;
            double last = problem.loss(b, all), first = last;
            for (int i = 0; i < 60; ++i) {
                problem.improve(&b, prior, 0, all, &room);
                const double loss = problem.loss(b, all);
                EXPECT_LE(loss, last * (1 + 1e-6)) << paths << " paths, level " << bits << ", step " << i;
                last = loss;
            }
            if (bits == 0) {
                EXPECT_LT(last, 0.8 * first);
            }
        }
    }
}

/// A level's loss is that of the lifted matrix at the finest one: the family is nested.
TEST(Gamma, LiftedMatricesHaveTheLossOfTheirLevel) {
    const GammaDataset data = Problem(32, 5).draw(5000, 6);
    const std::vector<uint32_t> all = all_of(data);
    const LevelProblem coarse(data, 2, 0), fine(data, 0, 0);
    std::vector<float> b = coarse.flat_prior();
    std::vector<double> room;
    for (int i = 0; i < 5; ++i) coarse.improve(&b, coarse.flat_prior(), 0.1, all, &room);
    const double loss = coarse.loss(b, all);
    EXPECT_NEAR(fine.loss(fine.lifted(coarse, b), all), loss, 1e-5 * loss);
}

TEST(Gamma, ColumnsAreDistributionsAboveTheMix) {
    for (const GammaTrainer trainer : {GammaTrainer::kMm, GammaTrainer::kAdam, GammaTrainer::kContribution}) {
        for (const size_t paths : {size_t(0), size_t(1), size_t(50), size_t(5000)}) {
            for (const uint32_t size : {1u, 3u, 40u}) {
                GammaDataset data = Problem(size, 7).draw(paths, 8);
                // Paths without a finite density, and none of the other kind.
                if (paths > 10) data.paths[3].fixed = 0, data.paths[4].weight = 0;
                GammaOptions options;
                options.trainer = trainer;
                options.mix = 0.1;
                GammaReport report;
                const std::vector<float> gamma = train_gamma(data, options, &report);
                ASSERT_EQ(gamma.size(), size_t(size) * size);
                const double total = std::accumulate(data.energy.begin(), data.energy.end(), 0.0);
                for (uint32_t j = 0; j < size; ++j) {
                    double sum = 0;
                    for (uint32_t i = 0; i < size; ++i) {
                        const double g = double(gamma[size_t(j) * size + i]);
                        EXPECT_GE(g, options.mix * 0.5 * (1.0 / size + double(data.energy[i]) / total) * (1 - 1e-6));
                        sum += g;
                    }
                    EXPECT_NEAR(sum, 1, 1e-6);
                }
                EXPECT_TRUE(std::isfinite(report.loss));
                EXPECT_LE(report.light_resolution, size);
                // Once more: the same.
                EXPECT_EQ(train_gamma(data, options, &report), gamma);
            }
        }
    }
}

/// What is known of an eye subspace without paths is the prior, however long the others are trained.
TEST(Gamma, ColumnsWithoutPathsKeepThePrior) {
    GammaDataset data = Problem(3, 9).draw(45000, 10);
    const uint32_t unnamed = data.eye_count++;
    const double total = std::accumulate(data.energy.begin(), data.energy.end(), 0.0);
    for (const GammaTrainer trainer : {GammaTrainer::kMm, GammaTrainer::kAdam, GammaTrainer::kContribution}) {
        GammaOptions options;
        options.trainer = trainer;
        GammaReport report;
        const std::vector<float> gamma = train_gamma(data, options, &report);
        for (uint32_t i = 0; i < data.light_count; ++i)
            EXPECT_NEAR(double(gamma[unnamed * data.light_count + i]),
                        0.5 / data.light_count + 0.5 * double(data.energy[i]) / total, 1e-6);
    }
}

/// Paths that share a sub-path would confirm one another: they judge together or learn together. Here each has seven twins.
TEST(Gamma, PathsThatShareASubPathDoNotJudgeOneAnother) {
    constexpr size_t kPaths = 1500;
    constexpr uint32_t kTwins = 8, kBatches = 10;
    constexpr uint64_t kProblems = 24;
    struct Losses {
        double believed = 0, true_one = 0;  ///< Mean logarithms: on the paths held out, and on others.
    } apart, by_sample, by_batch;
    for (uint64_t seed = 0; seed < kProblems; ++seed) {
        const Problem problem(24, 400 + seed);
        const GammaDataset drawn = problem.draw(kPaths, 500 + seed), judge = problem.draw(100000, 600 + seed);
        GammaDataset data = drawn;
        data.paths.clear();
        for (const GammaPath& p : drawn.paths) data.paths.insert(data.paths.end(), kTwins, p);
        const auto train = [&](Losses* losses, const auto& mark) {
            for (uint32_t x = 0; x < data.paths.size(); ++x) mark(data.paths[x], x);
            GammaReport report;
            losses->true_one += std::log(gamma_loss(judge, train_gamma(data, {}, &report))) / kProblems;
            losses->believed += std::log(report.loss) / kProblems;
        };
        train(&apart, [](GammaPath& p, uint32_t x) { p.sample = x; });
        train(&by_sample, [](GammaPath& p, uint32_t x) { p.sample = x / kTwins; });
        train(&by_batch, [](GammaPath& p, uint32_t x) { p.sample = x, p.batch = uint32_t(x / kTwins * kBatches / kPaths); });
    }
    RecordProperty("apart", std::to_string(std::exp(apart.believed - apart.true_one)));
    RecordProperty("by sample", std::to_string(std::exp(by_sample.believed - by_sample.true_one)));
    EXPECT_LT(apart.believed, apart.true_one + std::log(0.5));  // it believes itself twice as good as it is
    EXPECT_GT(by_sample.believed, by_sample.true_one + std::log(0.75));
    EXPECT_GT(by_batch.believed, by_batch.true_one + std::log(0.75));
}

/// The default trainer is the safe one. Both are judged on paths that neither has seen; the bounds are those of the issue.
TEST(Gamma, RegularisedTrainerIsSaferThanAdam) {
    const struct {
        size_t paths_per_cell;
        double bound;
        uint64_t problems;  ///< Few paths tell two trainers apart by luck: more problems.
    } rows[] = {{1, 0.8, 24}, {10, 1.15, 6}, {100, 1.02, 2}};
    constexpr uint32_t kSize = 64;
    for (const auto& row : rows) {
        double ratio = 0;
        for (uint64_t seed = 0; seed < row.problems; ++seed) {
            const Problem problem(kSize, 100 + seed);
            const GammaDataset data = problem.draw(row.paths_per_cell * kSize * kSize, 200 + seed);
            const GammaDataset judge = problem.draw(200000, 300 + seed);
            const auto loss_of = [&](GammaTrainer trainer) {
                GammaOptions options;
                options.trainer = trainer;
                GammaReport report;
                return gamma_loss(judge, train_gamma(data, options, &report));
            };
            const double mm = loss_of(GammaTrainer::kMm), adam = loss_of(GammaTrainer::kAdam);
            ratio += std::log(mm / adam) / double(row.problems);
        }
        RecordProperty("mm over adam at " + std::to_string(row.paths_per_cell), std::to_string(std::exp(ratio)));
        EXPECT_LE(std::exp(ratio), row.bound) << row.paths_per_cell << " paths per cell";
    }
}

}  // namespace
}  // namespace lightloom
