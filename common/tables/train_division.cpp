#include "common/tables/train_division.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "common/tables/weighted_split.h"

namespace lightloom {
namespace {

constexpr size_t kAxes = 6;  ///< Position and normal; points on lights have no third vector.

/// Share of all weight that the emitted points get, and how much less they count for the second half of the cells. There they
/// only show where a cell reaches beyond what is seen; a cell without any seen point is hardly worth being divided.
constexpr double kEmittedShare = 0.5, kEmittedImportance = 1e-3;
/// A leaf is split at the widest gap within so many standard deviations of its mean.
constexpr float kReach = 0.25f;

struct Point {
    std::array<float, kAxes> x;
    float weight = 0;
    float per_cache = 0;
    float importance = 0;  ///< The weight of a seen point, and a small part of that of an emitted one.
};

/// Grows a tree from one leaf by splitting the worst leaf again and again. For half of the cells all points count alike:
/// what training has not seen may matter all the same. For the others those count that were seen.
class Splitter {
  public:
    Splitter(std::vector<Point> points, const DivisionOptions& options) : points_(std::move(points)), options_(options) {}

    /// At most `cells` leaves, numbered from `first_label` in the order of their places in the tree.
    SubspaceTree split(uint32_t cells, uint32_t first_label) {
        Leaf root{.end = points_.size()};
        measure(&root);
        // Distances are those of longer prefixes: sigma^2 is the largest variance of the positions along an axis.
        const double variance = *std::max_element(root.spread.begin(), root.spread.begin() + 3) / root.weight;
        std::fill_n(scale_.begin(), 3, variance > 0 ? 1 / variance : 1.0);
        std::fill(scale_.begin() + 3, scale_.end(), 0.5);
        measure(&root);
        nodes_.assign(1, SubspaceTree::make_leaf(0));
        std::vector<Leaf> open{root};
        uint32_t count = 1;
        grow(&Leaf::extent, cells / 2, &open, &count);
        grow(&Leaf::error, cells, &open, &count);
        number(0, &first_label);
        return SubspaceTree(std::move(nodes_)).compacted();
    }

  private:
    struct Leaf {
        size_t begin = 0, end = 0;
        uint32_t node = 0, depth = 0;
        uint32_t axis = 0;  ///< Where it would be split.
        float mean = 0;     ///< Of the points on that axis.
        double weight = 0;
        /// The weight or the importance, times the mean squared distance of all points, seen or not, from their mean.
        double extent = 0, error = 0;
        std::array<double, kAxes> spread{};  ///< Sums of weighted squared distances from the mean, unscaled.
    };

    template <class Iterator>
    static double per_cache(Iterator begin, Iterator end) {
        return std::accumulate(begin, end, 0.0, [](double sum, const Point& p) { return sum + double(p.per_cache); });
    }

    /// Splits the leaf with the largest value of `error` until there are as many as `cells`.
    void grow(double Leaf::*error, uint32_t cells, std::vector<Leaf>* open, uint32_t* count) {
        const auto less = [error](const Leaf& a, const Leaf& b) {
            return a.*error < b.*error || (a.*error == b.*error && a.node > b.node);
        };
        std::make_heap(open->begin(), open->end(), less);
        while (*count < cells && !open->empty() && !options_.stop.stop_requested()) {
            std::pop_heap(open->begin(), open->end(), less);
            const Leaf leaf = open->back();
            open->pop_back();
            if (!(leaf.*error > 0) || leaf.depth >= SubspaceTree::kMaxDepth) continue;
            const auto begin = points_.begin() + std::ptrdiff_t(leaf.begin), end = points_.begin() + std::ptrdiff_t(leaf.end);
            // The plane of a lamp may lie at the mean.
            const auto coordinate = [&](const Point& p) { return p.x[leaf.axis]; };
            const float reach = kReach * float(std::sqrt(leaf.spread[leaf.axis] / leaf.weight));
            const auto threshold = widest_gap(std::span<const Point>(begin, end), coordinate, leaf.mean - reach, leaf.mean + reach);
            if (!threshold) continue;
            const auto middle = std::stable_partition(begin, end, [&](const Point& p) { return coordinate(p) < *threshold; });
            if (per_cache(begin, middle) < options_.fewest || per_cache(middle, end) < options_.fewest) continue;
            const uint32_t left = uint32_t(nodes_.size());
            nodes_[leaf.node] = SubspaceTree::make_inner(leaf.axis, *threshold, left);
            nodes_.resize(nodes_.size() + 2, SubspaceTree::make_leaf(0));
            const size_t at = size_t(middle - points_.begin());
            for (Leaf half : {Leaf{leaf.begin, at, left, leaf.depth + 1}, Leaf{at, leaf.end, left + 1, leaf.depth + 1}}) {
                measure(&half);
                open->push_back(half);
                std::push_heap(open->begin(), open->end(), less);
            }
            ++*count;
        }
    }

    void measure(Leaf* leaf) const {
        double total = 0, importance = 0;
        std::array<double, kAxes> sum{}, square{};
        const std::array<float, kAxes>& origin = points_[leaf->begin].x;  // nothing cancels far from the scene's origin
        for (size_t i = leaf->begin; i < leaf->end; ++i) {
            const double w = double(points_[i].weight);
            total += w;
            importance += double(points_[i].importance);
            for (size_t a = 0; a < kAxes; ++a) {
                const double d = double(points_[i].x[a]) - double(origin[a]);
                sum[a] += w * d, square[a] += w * d * d;
            }
        }
        double widest = 0, error = 0;
        for (size_t a = 0; a < kAxes; ++a) {
            leaf->spread[a] = std::max(0.0, square[a] - sum[a] * sum[a] / total);
            const double scaled = leaf->spread[a] * scale_[a];
            error += scaled;
            if (scaled > widest) {
                widest = scaled;
                leaf->axis = uint32_t(a);
                leaf->mean = float(double(origin[a]) + sum[a] / total);
            }
        }
        leaf->weight = total;
        leaf->extent = error;
        leaf->error = importance * error / total;
    }
    void number(uint32_t node, uint32_t* label) {
        if (nodes_[node].axis() == SubspaceTree::kLeaf) {
            nodes_[node] = SubspaceTree::make_leaf((*label)++);
            return;
        }
        const uint32_t left = nodes_[node].child();
        number(left, label);
        number(left + 1, label);
    }

    std::vector<Point> points_;
    const DivisionOptions& options_;
    std::array<double, kAxes> scale_{};
    std::vector<SubspaceTree::Node> nodes_;
};

}  // namespace

LightDivision train_division(const EmitterSet& emitters, const std::vector<WeightedSource>& seen,
                             const std::vector<WeightedSource>& emitted, const DivisionOptions& options) {
    const uint32_t cells = std::max(1u, options.cells);
    // More cells than these cannot be told apart: a light at a point is one, and so is one direction.
    uint32_t most_finite = 0, most_infinite = 0;
    for (const Emitter& e : emitters.all()) {
        uint32_t& most = e.is_infinite() ? most_infinite : most_finite;
        most = e.is_discrete() ? std::min(cells, most + 1) : cells;
    }
    std::vector<Point> points;
    double of_finite = 0, of_infinite = 0;  // importance
    const auto add = [&](const std::vector<WeightedSource>& list, double share, double importance) {
        double total = 0;
        for (const WeightedSource& s : list) total += double(s.weight);
        for (const WeightedSource& s : list) {
            const Emitter& e = emitters[s.emitter];
            const double weight = share * double(s.weight) / total;
            if (!(weight > 0) || !std::isfinite(weight)) continue;
            if (e.is_infinite()) {
                of_infinite += importance * weight;
                continue;
            }
            const SubPathEnd x0 = source_end(e, s.position);
            const Point point{{x0.position.x, x0.position.y, x0.position.z, x0.normal.x, x0.normal.y, x0.normal.z},
                              float(weight),
                              s.per_cache,
                              float(importance * weight)};
            if (!(point.weight > 0) || !std::all_of(point.x.begin(), point.x.end(), [](float x) { return std::isfinite(x); }))
                continue;
            points.push_back(point);
            of_finite += importance * weight;
        }
    };
    add(seen, 1 - kEmittedShare, 1);
    add(emitted, kEmittedShare, kEmittedImportance);

    // Cells are shared by importance. What finite lights cannot use infinite ones get, and the reverse.
    uint32_t for_infinite = 0;
    if (of_finite + of_infinite > 0) for_infinite = uint32_t(std::lround(cells * of_infinite / (of_finite + of_infinite)));
    for_infinite = std::max(std::min(1u, most_infinite), std::min({for_infinite, most_infinite, cells - (points.empty() ? 0 : 1)}));
    const uint32_t for_finite = std::min(cells - for_infinite, most_finite);
    SubspaceTree finite;
    if (!points.empty()) finite = Splitter(std::move(points), options).split(for_finite, 0);
    // Where there is but one cell, it is everybody's.
    const uint32_t first = for_finite > 0 ? finite.label_end() : 0;
    return LightDivision::divide(emitters, std::move(finite), first, std::min(cells - first, most_infinite));
}

}  // namespace lightloom
