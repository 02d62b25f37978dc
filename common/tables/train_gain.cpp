#include "common/tables/train_gain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "common/tables/weighted_split.h"

namespace lightloom {
namespace {

/// A place with twice as many visits is divided at their median; where many lie in one plane, a part may have fewer than half
/// of them, but not fewer than these.
constexpr size_t kLeafVisits = 400, kFewestVisits = 100;
/// More visits than these make the table no better; which are taken has nothing to do with their order.
constexpr size_t kMostVisits = 400000;
/// Normals count as places that lie this share of the scene's extent apart.
constexpr double kNormalExtent = 0.25;
/// A gain that so many equally lucky visits have shown is believed to one half: the other half is the gain of the
/// surroundings where roulette asks, and zero where splitting does.
constexpr double kKeepStrength = 3, kSplitStrength = 4;
/// What goes on costs something even where it never arrives: vertices per visit.
constexpr double kLeastCost = 0.05;
/// Relative variance of a sample, at least, so that a scene without noise is not split without end.
constexpr double kLeastVariance = 0.1;

struct Visit {
    std::array<float, 6> place;  ///< Position and normal.
    float gain, vertices;
};

class Trainer {
  public:
    Trainer(double tau, std::stop_token stop) : tau_(tau), stop_(std::move(stop)) {}

    void train(std::span<Visit> visits, GainData* table) {
        for (size_t a = 0; a < 3; ++a) {
            float low = HUGE_VALF, high = -HUGE_VALF;
            for (const Visit& v : visits) low = std::min(low, v.place[a]), high = std::max(high, v.place[a]);
            extent_ = std::max(extent_, double(high) - double(low));
        }
        table->nodes.resize(1);
        split(visits, 0, nullptr, table);
    }

  private:
    struct Moments {
        double keep = 0;   ///< E[g^2] / E[c], with a share of the surroundings'.
        double split = 0;  ///< Var[g] / E[c], as far as it is sure.
    };

    static Moments moments(std::span<const Visit> visits, const Moments* surroundings) {
        double sum = 0, squares = 0, vertices = 0;
        for (const Visit& v : visits) {
            const double g = double(v.gain);
            sum += g, squares += g * g, vertices += double(v.vertices);
        }
        const double n = double(visits.size()), mean = sum / n, second = squares / n;
        const double cost = std::max(vertices / n, kLeastCost);
        const double lucky = squares > 0 ? sum * sum / squares : 0;
        const double believed = lucky / (lucky + kKeepStrength), sure = lucky / (lucky + kSplitStrength);
        return {surroundings ? believed * second / cost + (1 - believed) * surroundings->keep : second / cost,
                sure * sure * std::max(0.0, second - mean * mean) / cost};
    }

    /// The axis on which places differ most, if they differ.
    std::optional<size_t> longest_axis(std::span<const Visit> visits) const {
        std::optional<size_t> longest;
        double most = 0;
        for (size_t a = 0; a < 6; ++a) {
            const double scale = a < 3 ? 1 : kNormalExtent * extent_, n = double(visits.size()),
                         origin = double(visits[0].place[a]);
            double sum = 0, squares = 0;
            for (const Visit& v : visits) {
                const double x = scale * (double(v.place[a]) - origin);
                sum += x, squares += x * x;
            }
            const double variance = squares / n - (sum / n) * (sum / n);
            if (variance > most) most = variance, longest = a;
        }
        return longest;
    }

    void split(std::span<Visit> visits, size_t at, const Moments* surroundings, GainData* table) {
        const Moments here = moments(visits, surroundings);
        if (visits.size() >= 2 * kLeafVisits && !stop_.stop_requested()) {
            if (const auto axis = longest_axis(visits)) {
                const auto coordinate = [&](const Visit& v) { return v.place[*axis]; };
                coordinates_.clear();
                for (const Visit& v : visits) coordinates_.push_back(coordinate(v));
                const auto rank = [&](double share) {
                    const auto nth = coordinates_.begin() + std::ptrdiff_t(share * double(coordinates_.size()));
                    std::nth_element(coordinates_.begin(), nth, coordinates_.end());
                    return *nth;
                };
                const std::optional<float> threshold = widest_gap(visits, coordinate, rank(0.4), rank(0.6));
                const auto half =
                    std::stable_partition(visits.begin(), visits.end(), [&](const Visit& v) { return coordinate(v) < threshold; });
                const size_t count = size_t(half - visits.begin());
                if (count >= kFewestVisits && visits.size() - count >= kFewestVisits) {
                    const uint32_t left = uint32_t(table->nodes.size());
                    table->nodes[at] = GainData::make_inner(uint32_t(*axis), *threshold, left);
                    table->nodes.resize(table->nodes.size() + 2);
                    split(visits.first(count), left, &here, table);
                    split(visits.subspan(count), left + 1, &here, table);
                    return;
                }
            }
        }
        table->nodes[at] = GainData::make_leaf(uint32_t(table->gains.size()));
        table->gains.push_back({in_range(tau_ * std::sqrt(here.keep)), in_range(tau_ * std::sqrt(here.split))});
    }

    static float in_range(double v) { return float(std::min(v, double(std::numeric_limits<float>::max()))); }

    double tau_, extent_ = 0;
    std::stop_token stop_;
    std::vector<float> coordinates_;
};

}  // namespace

GainData train_gain(const TrainingData& data, const std::vector<double>& brightness, const std::stop_token& stop) {
    if (data.visits.empty() || data.samples == 0 || data.block_square.empty()) return {};
    double second = 0;
    for (size_t b = 0; b < brightness.size(); ++b) {
        if (!(brightness[b] > 0 && std::isfinite(float(brightness[b]))) || !(float(brightness[b]) > 0)) return {};
        const double relative = data.block_square[b] / (brightness[b] * brightness[b]);
        if (std::isfinite(relative)) second += relative;
    }
    second /= double(data.samples);
    const double cost = double(data.visits.size()) / double(data.samples);
    const double tau = std::sqrt(cost / std::max(kLeastVariance, second - 1));

    const size_t step = (data.visits.size() + kMostVisits - 1) / kMostVisits;
    std::vector<Visit> visits;
    visits.reserve(data.visits.size() / step + 1);
    bool found = false;
    for (size_t i = 0; i < data.visits.size(); ++i) {
        if ((uint64_t(i) * 0x9e3779b97f4a7c15ull >> 32) % step != 0) continue;
        const TrainingVisit& v = data.visits[i];
        if (!(v.gain >= 0 && std::isfinite(v.gain) && v.vertices >= 0 && std::isfinite(v.vertices))) continue;
        const Vec3 normal = v.normal;
        visits.push_back({{v.position.x, v.position.y, v.position.z, normal.x, normal.y, normal.z}, v.gain, v.vertices});
        found |= v.gain > 0;
    }
    if (!found) return {};
    GainData table;
    table.blocks_x = data.blocks_x, table.blocks_y = data.blocks_y;
    for (const double b : brightness) table.brightness.push_back(float(b));
    Trainer(tau, stop).train(visits, &table);
    return table;
}

}  // namespace lightloom
