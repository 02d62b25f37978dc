// The formulas that common/path/README.md corrects ("Corrections of the papers") and two of the mistakes that bias ("What would
// bias"), in models of one dimension: what the literal formula gives, and what the corrected one does. Nothing here is the
// product's code.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <vector>

#include "common/core/low_discrepancy.h"
#include "common/core/rng.h"

namespace lightloom {
namespace {

struct Mean {
    double sum = 0, squares = 0;
    int count = 0;

    void add(double v) { sum += v, squares += v * v, ++count; }
    double value() const { return sum / count; }
    double variance() const { return squares / count - value() * value(); }
    double error() const { return std::sqrt(variance() / count); }
};

/// Equal within 4.5 standard errors, which chance exceeds once in 10^5 times.
void expect_mean(const Mean& mean, double expected, const char* what) {
    EXPECT_NEAR(mean.value(), expected, 4.5 * mean.error()) << what;
}

/// An index drawn in proportion to `r`.
size_t draw(const std::vector<double>& r, Rng& rng) {
    double u = rng.uniform_double() * std::accumulate(r.begin(), r.end(), 0.0);
    size_t i = 0;
    while (i + 1 < r.size() && (u -= r[i]) > 0) ++i;
    return i;
}

Rng stream(uint64_t number) { return Rng({11, Stage::kTraining, 0, number}); }

/// Prefixes that light paths drop into one subspace: one path in a hundred drops one of throughput 0.5, another nine of 1.5. What
/// is estimated is the subspace's throughput per path, after nine iterations of a hundred paths.
struct Reuse {
    static constexpr double kTruth = 0.01 * 0.5 + 0.01 * 9 * 1.5;
    Mean queue, literal, window;

    Reuse(size_t longest, int repetitions) {
        constexpr int kPaths = 100, kIterations = 9;
        for (int n = 0; n < repetitions; ++n) {
            Rng rng = stream(uint64_t(n));
            std::deque<double> retained;
            double generated = 0, total = 0;
            for (int path = 0; path < kPaths * kIterations; ++path) {
                const double u = rng.uniform_double();
                const int prefixes = u < 0.98 ? 0 : u < 0.99 ? 1 : 9;
                for (int i = 0; i < prefixes; ++i) {
                    const double r = prefixes == 9 ? 1.5 : 0.5;
                    retained.push_back(r);
                    if (retained.size() > longest) retained.pop_front();
                    generated += 1, total += r;
                }
            }
            const double paths = kPaths * kIterations, sum = std::accumulate(retained.begin(), retained.end(), 0.0);
            // f / (j M P_r) with f = r and P_r = M_r / M_gen r / sum: it does not depend on the draw.
            const double by_queue = retained.empty() ? 0 : generated / double(retained.size()) * sum / paths;
            queue.add(by_queue / kTruth);
            literal.add(by_queue * double(retained.size()) / kTruth);
            window.add(total / paths / kTruth);
        }
    }
};

TEST(PaperCorrections, QueuesOfPrefixesAreBiasedAndWindowsOfPathsAreNot) {
    const Reuse shortest(5, 60000), longer(20, 60000), longest(200, 2000);
    EXPECT_NEAR(shortest.queue.value(), 0.944, 4.5 * shortest.queue.error());
    EXPECT_LT(shortest.queue.value() + 20 * shortest.queue.error(), 1);
    EXPECT_NEAR(longer.queue.value(), 0.994, 4.5 * longer.queue.error());
    expect_mean(longest.queue, 1, "a queue that nothing leaves");
    for (const Reuse* reuse : {&shortest, &longer, &longest}) expect_mean(reuse->window, 1, "a window of paths");
    // Su, Li and Wang 2022, eq. 20: M_r times too bright.
    EXPECT_NEAR(shortest.literal.value(), 4.72, 4.5 * shortest.literal.error());
}

/// Nabata, Iwasaki and Dobashi 2020b: one of each cluster's prefixes, then one of these.
TEST(PaperCorrections, ClustersContributeTheirOwnSums) {
    constexpr size_t kPaths = 64, kClusters = 8, kInCluster = kPaths / kClusters;
    Mean literal, corrected;
    for (int n = 0; n < 60000; ++n) {
        Rng rng = stream(uint64_t(n));
        std::vector<double> y(kPaths);
        for (double& v : y) v = rng.uniform_double();
        std::sort(y.begin(), y.end());
        std::vector<double> chosen, p1, q;
        for (size_t c = 0; c < kClusters; ++c) {
            std::vector<double> r;
            for (size_t i = 0; i < kInCluster; ++i) r.push_back(1 + y[c * kInCluster + i]);
            const size_t i = draw(r, rng);
            chosen.push_back(y[c * kInCluster + i]);
            p1.push_back(r[i] / std::accumulate(r.begin(), r.end(), 0.0));
            q.push_back(1 + 0.5 * chosen.back());
        }
        const size_t c = draw(q, rng);
        const double p2 = q[c] / std::accumulate(q.begin(), q.end(), 0.0);
        corrected.add((1 - chosen[c] * chosen[c]) / (kPaths * p1[c] * p2));
        literal.add((1 - chosen[c] * chosen[c]) / (kPaths * kClusters * p1[c] * p2));
    }
    expect_mean(corrected, 2.0 / 3, "without 1 / M2");
    expect_mean(literal, 2.0 / 3 / kClusters, "eq. 15");
}

/// Chaitanya et al. 2018: the variance of a frame's sum, given its sub-paths.
TEST(PaperCorrections, SortedSubPathsWantAStructuredPairing) {
    constexpr uint32_t kCount = 1024;
    Mean unsorted, shuffled, structured;
    const auto f = [](double a, double b) { return std::exp(-4 * (a - b) * (a - b)); };
    for (int n = 0; n < 100; ++n) {
        Rng rng = stream(uint64_t(n));
        std::vector<double> eye(kCount), light(kCount);
        for (uint32_t i = 0; i < kCount; ++i) eye[i] = rng.uniform_double(), light[i] = rng.uniform_double();
        double pairs = 0, all = 0;
        for (uint32_t i = 0; i < kCount; ++i) pairs += f(eye[i], light[i]);
        std::sort(eye.begin(), eye.end()), std::sort(light.begin(), light.end());
        for (uint32_t i = 0; i < kCount; ++i)
            for (uint32_t j = i % 8; j < kCount; j += 8) all += 8 * f(eye[i], light[j]) / kCount;
        std::vector<uint32_t> order(kCount);
        std::iota(order.begin(), order.end(), 0u);
        for (uint32_t i = kCount; i > 1; --i) std::swap(order[i - 1], order[rng.below(i)]);
        double permuted = 0, reversed = 0;
        const uint32_t scramble = rng.below(kCount);
        for (uint32_t i = 0; i < kCount; ++i) {
            permuted += f(eye[i], light[order[i]]);
            reversed += f(eye[i], light[(reverse_bits(i) >> 22) ^ scramble]);
        }
        unsorted.add((pairs - all) / kCount), shuffled.add((permuted - all) / kCount), structured.add((reversed - all) / kCount);
    }
    // Two variances of a hundred numbers each: a factor of 1.8 is 4 standard deviations.
    EXPECT_LT(std::fabs(std::log(shuffled.variance() / unsorted.variance())), std::log(1.8));
    EXPECT_LT(structured.variance() * 30, shuffled.variance());
}

/// Two techniques, one of which resamples M prefixes with the target r / Q.
TEST(PaperCorrections, TargetsAndTablesOfTheSameCacheBias) {
    const auto throughput = [](double y) { return 0.2 + 20 * std::pow(y, 8); };
    const double truth = 0.2 + 20.0 / 9;
    const struct {
        int paths, repetitions;
        double target, own;
    } cases[] = {{2, 200000, -0.32, -0.18}, {20, 200000, -0.030, -0.020}, {100, 60000, -0.006, -0.003}};
    for (const auto& c : cases) {
        Mean right, divided_by_target, q_of_the_cache;
        for (int n = 0; n < c.repetitions; ++n) {
            Rng rng = stream(uint64_t(n));
            std::vector<double> r(size_t(c.paths));
            for (double& v : r) v = throughput(rng.uniform_double());
            const double sum = std::accumulate(r.begin(), r.end(), 0.0), other = throughput(rng.uniform_double());
            const double drawn = r[draw(r, rng)];
            const auto estimate = [&](double q, double density) {
                const double w = drawn / q / (drawn / q + 1), rest = 1 / (other / q + 1);
                return (w * drawn / density + rest * other) / truth;
            };
            right.add(estimate(truth, c.paths * drawn / sum));
            divided_by_target.add(estimate(truth, drawn / truth));
            q_of_the_cache.add(estimate(sum / c.paths, c.paths * drawn / sum));
        }
        expect_mean(right, 1, "independent Q, probability of the draw");
        EXPECT_NEAR(divided_by_target.value(), 1 + c.target, 0.01 + 4.5 * divided_by_target.error()) << c.paths;
        EXPECT_NEAR(q_of_the_cache.value(), 1 + c.own, 0.01 + 4.5 * q_of_the_cache.error()) << c.paths;
        if (c.paths <= 20) {
            EXPECT_LT(divided_by_target.value() + 5 * divided_by_target.error(), 1) << c.paths;
            EXPECT_LT(q_of_the_cache.value() + 5 * q_of_the_cache.error(), 1) << c.paths;
        }
    }
}

}  // namespace
}  // namespace lightloom
