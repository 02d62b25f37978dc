#include "common/tables/train_classifier.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include "common/core/fork_join.h"
#include "common/core/math.h"
#include "common/core/rng.h"
#include "common/tables/weighted_split.h"

namespace lightloom {
namespace {

constexpr size_t kAxes = SubspaceTree::kAxes;
constexpr double kPurity = 0.99;
constexpr uint32_t kNodesPerSubspace = 64;

/// An end as a point of a Euclidean space in which the squared distance of two ends is the distance of [Su, Li and Wang 2022, eq.
/// 18] over sigma^2: |dx|^2 / sigma^2 + (1 - n n') + k_d (1 - d d'), where 1 - n n' = |n - n'|^2 / 2 for unit vectors.
using Point = std::array<float, kAxes>;

struct Space {
    Point scale;

    Space(const std::vector<WeightedEnd>& ends, float direction_weight) {
        // sigma^2 is the largest variance of the positions along an axis.
        double sum[3] = {}, square[3] = {}, total = 0;
        for (const WeightedEnd& e : ends) {
            for (int a = 0; a < 3; ++a) {
                const double x = double(e.end.position[a]);
                sum[a] += double(e.weight) * x;
                square[a] += double(e.weight) * x * x;
            }
            total += double(e.weight);
        }
        double variance = 0;
        for (int a = 0; a < 3 && total > 0; ++a)
            variance = std::max(variance, square[a] / total - (sum[a] / total) * (sum[a] / total));
        const float inv_sigma = variance > 0 ? float(1 / std::sqrt(variance)) : 1;
        const float normal = std::sqrt(0.5f), direction = std::sqrt(0.5f * direction_weight);
        scale = {inv_sigma, inv_sigma, inv_sigma, normal, normal, normal, direction, direction, direction};
    }
    static Point raw(const SubPathEnd& e) {
        return {e.position.x, e.position.y,  e.position.z,  e.normal.x,   e.normal.y,
                e.normal.z,   e.direction.x, e.direction.y, e.direction.z};
    }
    Point point(const SubPathEnd& e) const {
        Point p = raw(e);
        for (size_t a = 0; a < kAxes; ++a) p[a] *= scale[a];
        return p;
    }
};

struct Bounds {
    Point low, high;
    Bounds() { low.fill(HUGE_VALF), high.fill(-HUGE_VALF); }
    void add(const Point& p) {
        for (size_t a = 0; a < kAxes; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
    }
    size_t widest() const {
        size_t best = 0;
        for (size_t a = 1; a < kAxes; ++a)
            if (high[a] - low[a] > high[best] - low[best]) best = a;
        return best;
    }
};

/// Systematic resampling in proportion to the weights (cut at their 99.9 % quantile, so that no outlier takes several
/// places) over a seeded shuffle, each end at most once.
std::vector<Point> choose_centroids(const std::vector<WeightedEnd>& ends, const Space& space, uint32_t count, uint64_t seed) {
    std::vector<float> weights;
    for (const WeightedEnd& e : ends) weights.push_back(e.weight);
    std::vector<float> sorted = weights;
    const size_t q = size_t(double(sorted.size() - 1) * 0.999);
    std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(q), sorted.end());
    const float cap = sorted[q] > 0 ? sorted[q] : HUGE_VALF;

    Rng rng({seed, Stage::kTraining, 1, 0});
    std::vector<uint32_t> order(ends.size());
    std::iota(order.begin(), order.end(), 0u);
    for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[size_t(rng.next_u64() % i)]);
    double total = 0;
    for (const uint32_t i : order) total += double(std::min(weights[i], cap));
    std::vector<Point> centroids;
    if (!(total > 0)) return centroids;
    const double step = total / count;
    double next = step * rng.uniform_double(), sum = 0;
    for (const uint32_t i : order) {
        sum += double(std::min(weights[i], cap));
        if (sum <= next) continue;
        centroids.push_back(space.point(ends[i].end));
        while (next < sum) next += step;
    }
    return centroids;
}

/// Puts the centroids into the order of a balanced kd-tree.
void order_centroids(std::vector<Point>& c, size_t begin, size_t end) {
    if (end - begin < 2) return;
    Bounds bounds;
    for (size_t i = begin; i < end; ++i) bounds.add(c[i]);
    const size_t axis = bounds.widest();
    const size_t middle = begin + (end - begin) / 2;
    const auto less = [axis](const Point& a, const Point& b) { return a[axis] != b[axis] ? a[axis] < b[axis] : a < b; };
    std::nth_element(c.begin() + std::ptrdiff_t(begin), c.begin() + std::ptrdiff_t(middle), c.begin() + std::ptrdiff_t(end), less);
    order_centroids(c, begin, middle);
    order_centroids(c, middle, end);
}

/// Index of the nearest centroid of every end.
std::vector<uint32_t> nearest(const std::vector<WeightedEnd>& ends, const Space& space, const std::vector<Point>& centroids,
                              const std::stop_token& stop) {
    // The centroids are stored axis by axis, so that the inner loop runs over centroids in vector registers.
    std::array<std::vector<float>, kAxes> columns;
    for (size_t a = 0; a < kAxes; ++a)
        for (const Point& c : centroids) columns[a].push_back(c[a]);
    std::vector<uint32_t> labels(ends.size());
    fork_join(ends.size(), [&](size_t first, size_t last) {
        std::vector<float> distance(centroids.size());
        for (size_t e = first; e < last && !stop.stop_requested(); ++e) {
            const Point p = space.point(ends[e].end);
            std::fill(distance.begin(), distance.end(), 0.0f);
            for (size_t a = 0; a < kAxes; ++a) {
                const float* column = columns[a].data();
                for (size_t c = 0; c < distance.size(); ++c) {
                    const float d = p[a] - column[c];
                    distance[c] += d * d;
                }
            }
            labels[e] = uint32_t(std::min_element(distance.begin(), distance.end()) - distance.begin());
        }
    });
    return labels;
}

class TreeBuilder {
  public:
    TreeBuilder(const std::vector<WeightedEnd>& ends, const Space& space, std::vector<uint32_t> labels, uint32_t label_count,
                uint32_t first_label)
        : ends_(ends),
          space_(space),
          labels_(std::move(labels)),
          votes_(label_count, 0.0),
          first_label_(first_label),
          node_budget_(size_t(kNodesPerSubspace) * label_count) {}

    SubspaceTree build(const std::stop_token& stop) {
        // The tree grows breadth first, so that a spent node budget leaves every part of space equally fine.
        struct Task {
            uint32_t node;
            size_t begin, end;
            uint32_t depth;
        };
        std::vector<uint32_t> items(ends_.size());
        std::iota(items.begin(), items.end(), 0u);
        nodes_.assign(1, SubspaceTree::make_leaf(first_label_));
        std::vector<Task> tasks{{0, 0, items.size(), 0}};
        for (size_t t = 0; t < tasks.size() && !stop.stop_requested(); ++t) {
            const Task task = tasks[t];
            const auto begin = items.begin() + std::ptrdiff_t(task.begin), end = items.begin() + std::ptrdiff_t(task.end);
            bool pure = false;
            const uint32_t label = majority(begin, end, &pure);
            nodes_[task.node] = SubspaceTree::make_leaf(first_label_ + label);
            if (pure || task.depth >= SubspaceTree::kMaxDepth || nodes_.size() + 2 > node_budget_) continue;
            Bounds bounds;
            for (auto i = begin; i != end; ++i) bounds.add(space_.point(ends_[*i].end));
            const size_t axis = bounds.widest();
            const float scale = space_.scale[axis];
            if (!(scale > 0)) continue;
            const auto coordinate = [&](uint32_t i) { return Space::raw(ends_[i].end)[axis]; };
            const float centre = 0.5f * (bounds.low[axis] + bounds.high[axis]) / scale;
            const float reach = (bounds.high[axis] - bounds.low[axis]) / scale / 16;
            const std::optional<float> threshold =
                widest_gap(std::span<const uint32_t>(begin, end), coordinate, centre - reach, centre + reach);
            if (!threshold) continue;
            const auto middle = std::stable_partition(begin, end, [&](uint32_t i) { return coordinate(i) < *threshold; });
            if (middle == begin || middle == end) continue;  // all ends lie on one side
            const uint32_t left = uint32_t(nodes_.size());
            nodes_[task.node] = SubspaceTree::make_inner(uint32_t(axis), *threshold, left);
            nodes_.resize(nodes_.size() + 2, SubspaceTree::make_leaf(first_label_ + label));
            const size_t split = size_t(middle - items.begin());
            tasks.push_back({left, task.begin, split, task.depth + 1});
            tasks.push_back({left + 1, split, task.end, task.depth + 1});
        }
        return SubspaceTree(std::move(nodes_)).compacted();
    }

  private:
    template <class Iterator>
    uint32_t majority(Iterator begin, Iterator end, bool* pure) {
        double total = 0, best_vote = 0;
        uint32_t best = 0;
        for (auto i = begin; i != end; ++i) {
            double& vote = votes_[labels_[*i]];
            vote += double(ends_[*i].weight);
            total += double(ends_[*i].weight);
            if (vote > best_vote) best_vote = vote, best = labels_[*i];
        }
        for (auto i = begin; i != end; ++i) votes_[labels_[*i]] = 0;
        *pure = end - begin < 2 || best_vote >= kPurity * total;
        return best;
    }

    const std::vector<WeightedEnd>& ends_;
    const Space& space_;
    const std::vector<uint32_t> labels_;
    std::vector<double> votes_;
    const uint32_t first_label_;
    const size_t node_budget_;
    std::vector<SubspaceTree::Node> nodes_;
};

}  // namespace

SubspaceTree train_classifier(const std::vector<WeightedEnd>& ends, const ClassifierOptions& options) {
    const auto single = [&] { return SubspaceTree({SubspaceTree::make_leaf(options.first_label)}); };
    if (ends.empty() || options.subspaces < 2) return single();
    const Space space(ends, options.direction_weight);
    std::vector<Point> centroids = choose_centroids(ends, space, options.subspaces, options.seed);
    order_centroids(centroids, 0, centroids.size());
    centroids.erase(std::unique(centroids.begin(), centroids.end()), centroids.end());
    if (centroids.size() < 2) return single();
    std::vector<uint32_t> labels = nearest(ends, space, centroids, options.stop);
    return TreeBuilder(ends, space, std::move(labels), uint32_t(centroids.size()), options.first_label).build(options.stop);
}

}  // namespace lightloom
