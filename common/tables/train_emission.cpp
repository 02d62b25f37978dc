#include "common/tables/train_emission.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

#include "common/scene/emitter_square.h"
#include "common/tables/weighted_split.h"

namespace lightloom {
namespace {

constexpr float kPowerShare = 0.1f, kPowerPlaces = 0.15f, kPowerDirections = 0.1f;
/// Paths that one camera sample found have much in common, and a handful of lucky ones must not own the table.
constexpr double kCut = 0.99;
/// Direct light is made by next event estimation as well, which needs no light sub-path.
constexpr float kDirectLight = 0.25f;
constexpr size_t kMostPoints = 400000;

/// A cell of places is split while it has the paths of two cells and its places are this far apart, relative to the
/// distance of x_1; directions of infinite lights: in radians.
constexpr double kCellPaths = 200, kParallax = 0.04, kDirections = 0.03;
constexpr int kMostSplits = 10;

/// A quarter of a square is refined if it holds this share of the square's weight and so many effective paths.
constexpr double kRefinedShare = 0.005, kRefinedPaths = 12;
constexpr int kDeepest = 10;
/// A density on the places of an emitter needs as many effective paths, and a division of a group of emitters as well.
constexpr double kPlacePaths = 64, kGroupPaths = 24;

/// What a path teaches.
struct Lesson {
    Vec3 place;  ///< x_0 on a finite light; direction of travel of an infinite one.
    Vec3 x1;     ///< The vertex that the light reaches first.
    uint32_t emitter;
    float weight;
};

/// Weight of a set of paths and how many equally weighted ones would tell as much.
struct Support {
    double sum = 0, squares = 0;
    void add(double w) { sum += w, squares += w * w; }
    double paths() const { return squares > 0 ? sum * sum / squares : 0; }
};

/// A share of so many effective paths, drawn towards `prior` as by `strength` more of them.
double smoothed(double share, double paths, double prior, double strength) {
    return (share * paths + prior * strength) / (paths + strength);
}

class Trainer {
  public:
    Trainer(const EmitterSet& emitters, std::stop_token stop) : emitters_(emitters), stop_(std::move(stop)) {}

    EmissionData train(std::vector<Lesson> lessons) {
        const auto infinite = std::stable_partition(lessons.begin(), lessons.end(),
                                                    [&](const Lesson& l) { return !emitters_[l.emitter].is_infinite(); });
        const size_t finite_count = size_t(infinite - lessons.begin());
        const std::span<Lesson> all(lessons), finite = all.first(finite_count), others = all.subspan(finite_count);
        learn_emitters(all);
        learn_places(all);
        table_.finite = cells_of(finite, false);
        table_.infinite = cells_of(others, true);
        table_.power_share = kPowerShare, table_.power_places = kPowerPlaces, table_.power_directions = kPowerDirections;
        return std::move(table_);
    }

  private:
    /// Divides `mass` among the emitters [begin, end) of `order`, by what they contribute as far as that is known.
    void divide(std::span<uint32_t> order, double mass) {
        Support support;
        double power = 0;
        for (const uint32_t e : order)
            support.sum += by_emitter_[e].sum, support.squares += by_emitter_[e].squares, power += power_[e];
        const auto by_power = [&] {
            for (const uint32_t e : order) table_.emitters[e] = float(mass * power_[e] / power);
        };
        if (order.size() < 2 || support.paths() < kGroupPaths || stop_.stop_requested()) return by_power();
        const auto centre = [&](uint32_t e) {
            const Emitter& at = emitters_[e];
            return at.kind == EmitterKind::kTriangle ? at.position + (at.edge1 + at.edge2) / 3 : at.position;
        };
        const size_t half = split_at_median(order, centre, [&](uint32_t e) { return power_[e]; });
        if (half == 0 || half == order.size()) return by_power();  // all in one place
        double left = 0, left_power = 0;
        for (const uint32_t e : order.first(half)) left += by_emitter_[e].sum, left_power += power_[e];
        const double share = smoothed(left / support.sum, support.paths(), left_power / power, 2);
        divide(order.first(half), mass * share);
        divide(order.subspan(half), mass * (1 - share));
    }

    void learn_emitters(std::span<const Lesson> lessons) {
        const size_t count = emitters_.all().size();
        by_emitter_.resize(count);
        Support total;
        for (const Lesson& l : lessons) by_emitter_[l.emitter].add(double(l.weight)), total.add(double(l.weight));
        double power = 0;
        for (const Emitter& e : emitters_.all()) power_.push_back(double(e.pmf)), power += power_.back();
        table_.emitters.assign(count, 0);
        // Infinite lights have no place among the others.
        std::vector<uint32_t> finite;
        Support finite_support;
        double finite_power = 0;
        for (uint32_t e = 0; e < count; ++e) {
            if (emitters_[e].is_infinite()) {
                table_.emitters[e] = float(smoothed(by_emitter_[e].sum / total.sum, total.paths(), power_[e] / power, 2));
            } else if (power_[e] > 0) {
                finite.push_back(e);
                finite_support.sum += by_emitter_[e].sum;
                finite_power += power_[e];
            }
        }
        if (!finite.empty()) divide(finite, smoothed(finite_support.sum / total.sum, total.paths(), finite_power / power, 2));
        double sum = 0;
        for (const float p : table_.emitters) sum += double(p);
        for (float& p : table_.emitters) p = float(double(p) / sum);
    }

    void learn_places(std::span<const Lesson> lessons) {
        table_.places.assign(emitters_.all().size(), kUniformSquare);
        std::vector<std::vector<std::pair<Vec2, float>>> points(emitters_.all().size());
        for (const Lesson& l : lessons) {
            const Emitter& e = emitters_[l.emitter];
            if (!has_square(e) || by_emitter_[l.emitter].paths() < kPlacePaths) continue;
            points[l.emitter].push_back({emitter_square(e, l.place, l.place), l.weight});
        }
        for (size_t e = 0; e < points.size() && !stop_.stop_requested(); ++e)
            if (!points[e].empty()) table_.places[e] = density(points[e]);
    }

    /// The tree over the places of the lessons and the cells at its leaves.
    std::vector<EmissionData::Node> cells_of(std::span<Lesson> lessons, bool infinite) {
        std::vector<EmissionData::Node> nodes(1);
        split(lessons, infinite, 0, 0, &nodes);
        return nodes;
    }

    void split(std::span<Lesson> lessons, bool infinite, size_t at, int depth, std::vector<EmissionData::Node>* nodes) {
        if (depth < kMostSplits && !stop_.stop_requested() && spread(lessons, infinite)) {
            int axis = 0;
            float threshold = 0;
            const size_t half = split_at_median(
                lessons, [](const Lesson& l) { return l.place; }, [](const Lesson& l) { return double(l.weight); }, &axis,
                &threshold);
            if (paths_of(lessons.first(half)) >= kCellPaths && paths_of(lessons.subspan(half)) >= kCellPaths) {
                const uint32_t left = uint32_t(nodes->size());
                (*nodes)[at] = EmissionData::make_inner(uint32_t(axis), threshold, left);
                nodes->resize(nodes->size() + 2);
                split(lessons.first(half), infinite, left, depth + 1, nodes);
                split(lessons.subspan(half), infinite, left + 1, depth + 1, nodes);
                return;
            }
        }
        (*nodes)[at] = EmissionData::make_leaf(uint32_t(table_.cells.size()));
        table_.cells.push_back(cell_of(lessons, infinite));
    }

    static double paths_of(std::span<const Lesson> lessons) {
        Support support;
        for (const Lesson& l : lessons) support.add(double(l.weight));
        return support.paths();
    }

    /// Whether directions towards the same vertex differ within a cell of these places.
    static bool spread(std::span<const Lesson> lessons, bool infinite) {
        Support support;
        double mean[3] = {}, square = 0, distance = 0;
        for (const Lesson& l : lessons) {
            const double w = double(l.weight);
            support.add(w);
            for (int axis = 0; axis < 3; ++axis) mean[axis] += w * double(l.place[axis]);
            square += w * double(length_squared(l.place));
            if (!infinite) distance += w * double(length(l.x1 - l.place));
        }
        if (support.paths() < 2 * kCellPaths) return false;
        double variance = square / support.sum;
        for (const double m : mean) variance -= (m / support.sum) * (m / support.sum);
        const double limit = infinite ? kDirections : kParallax * distance / support.sum;
        return variance > limit * limit;
    }

    EmissionData::Cell cell_of(std::span<Lesson> lessons, bool infinite) {
        EmissionData::Cell cell;
        if (lessons.empty()) return cell;
        std::vector<std::pair<Vec2, float>> points;
        if (infinite) {
            double sum = 0, mean[3] = {};
            for (const Lesson& l : lessons) {
                sum += double(l.weight);
                for (int axis = 0; axis < 3; ++axis) mean[axis] += double(l.weight) * double(l.x1[axis]);
            }
            cell.pivot = {float(mean[0] / sum), float(mean[1] / sum), float(mean[2] / sum)};
            std::vector<Vec2> across;
            float half = 0;
            for (const Lesson& l : lessons) {
                const Frame frame(l.place);
                const Vec3 d = l.x1 - cell.pivot;
                across.push_back({dot(d, frame.s), dot(d, frame.t)});
                half = std::max({half, std::fabs(across.back().x), std::fabs(across.back().y)});
            }
            constexpr float kMargin = 1.05f, kLeast = 1e-3f;  // the least, of the scene, is for lessons that are all at one point
            cell.half = std::max(half * kMargin, emitters_.scene_radius() * kLeast);
            for (size_t i = 0; i < across.size(); ++i)
                points.push_back({{across[i].x / (2 * cell.half) + 0.5f, across[i].y / (2 * cell.half) + 0.5f}, lessons[i].weight});
        } else {
            for (const Lesson& l : lessons) {
                const Vec3 d = l.x1 - l.place;
                const float length2 = length_squared(d);
                if (length2 > 0) points.push_back({equal_area_sphere_to_square(d / std::sqrt(length2)), l.weight});
            }
        }
        cell.root = density(points);
        return cell;
    }

    /// Makes a density from weighted points and returns its root.
    uint32_t density(std::span<std::pair<Vec2, float>> points) {
        double total = 0;
        for (const auto& p : points) total += double(p.second);
        if (!(total > 0)) return kUniformSquare;
        const uint32_t root = uint32_t(table_.squares.size());
        table_.squares.emplace_back();
        refine(points, root, {0, 0}, 1, total, 0);
        return root;
    }

    void refine(std::span<std::pair<Vec2, float>> points, uint32_t node, Vec2 origin, float size, double total, int depth) {
        const float half = size / 2;
        const auto upper = std::partition(points.begin(), points.end(), [&](const auto& p) { return p.first.y < origin.y + half; });
        const auto in_left = [&](const auto& p) { return p.first.x < origin.x + half; };
        const auto right_below = std::partition(points.begin(), upper, in_left),
                   right_above = std::partition(upper, points.end(), in_left);
        const std::span<std::pair<Vec2, float>> quarters[4] = {
            {points.begin(), right_below}, {right_below, upper}, {upper, right_above}, {right_above, points.end()}};
        Support support, of[4];
        for (int q = 0; q < 4; ++q)
            for (const auto& p : quarters[q]) of[q].add(double(p.second)), support.add(double(p.second));
        double shares[4], sum = 0;
        for (int q = 0; q < 4; ++q) sum += shares[q] = smoothed(of[q].sum / support.sum, support.paths(), 0.25, 4);
        for (int q = 0; q < 4; ++q) {
            table_.squares[node].share[q] = float(shares[q] / sum);
            if (depth >= kDeepest || of[q].sum < kRefinedShare * total || of[q].paths() < kRefinedPaths) continue;
            const uint32_t child = uint32_t(table_.squares.size());
            table_.squares[node].child[q] = child;
            table_.squares.emplace_back();
            refine(quarters[q], child, {origin.x + (q & 1 ? half : 0), origin.y + (q & 2 ? half : 0)}, half, total, depth + 1);
        }
    }

    const EmitterSet& emitters_;
    const std::stop_token stop_;
    EmissionData table_;
    std::vector<Support> by_emitter_;
    std::vector<double> power_;
};

/// Makes one lesson of all that a single light sub-path taught: many camera sub-paths may have met it, and what they
/// found is not independent.
void join_equal(std::vector<Lesson>* lessons) {
    const auto key = [](const Lesson& l) { return std::tuple(l.emitter, l.x1.x, l.x1.y, l.x1.z, l.place.x, l.place.y, l.place.z); };
    std::stable_sort(lessons->begin(), lessons->end(), [&](const Lesson& a, const Lesson& b) { return key(a) < key(b); });
    size_t count = 0;
    for (size_t i = 0; i < lessons->size(); ++i) {
        const Lesson l = (*lessons)[i];
        if (count > 0 && key((*lessons)[count - 1]) == key(l))
            (*lessons)[count - 1].weight += l.weight;
        else
            (*lessons)[count++] = l;
    }
    lessons->resize(count);
}

}  // namespace

EmissionData train_emission(const TrainingData& data, const std::vector<double>& brightness, const EmitterSet& emitters,
                            std::stop_token stop) {
    std::vector<Lesson> lessons;
    const size_t stride = data.paths.size() / kMostPoints + 1;
    for (size_t x = 0; x < data.paths.size(); x += stride) {
        const TrainingPath& p = data.paths[x];
        if (p.vertex_count < 3 || !data.in_range(p)) continue;
        const TrainingVertex* v = &data.vertices[p.first_vertex];
        float weight = float(double(p.estimate) / brightness[p.block]);
        if (p.vertex_count == 3) weight *= kDirectLight;
        if (!(weight > 0) || !std::isfinite(weight)) continue;
        const Emitter& e = emitters[p.emitter];
        // A threshold may lie at the very direction of a distant light: a packed one would miss it.
        const Vec3 travel = e.kind == EmitterKind::kDistant ? e.normal : Vec3(v[0].normal);
        lessons.push_back({e.is_infinite() ? travel : v[0].position, v[1].position, p.emitter, weight});
    }
    if (lessons.empty() || stop.stop_requested()) return {};
    join_equal(&lessons);
    std::vector<float> weights;
    for (const Lesson& l : lessons) weights.push_back(l.weight);
    const auto cut = weights.begin() + std::ptrdiff_t(double(weights.size() - 1) * kCut);
    std::nth_element(weights.begin(), cut, weights.end());
    for (Lesson& l : lessons) l.weight = std::min(l.weight, *cut);
    return Trainer(emitters, std::move(stop)).train(std::move(lessons));
}

}  // namespace lightloom
