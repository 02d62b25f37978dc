#include "common/scene/emission_table.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/core/math.h"

namespace lightloom {
namespace {

constexpr float kBelowOne = 0x1.fffffep-1f;
/// Levels of a square, and half widths of cells, whose densities are within single precision together.
constexpr int kMostLevels = 24;
constexpr float kLeastHalf = 1e-9f, kMostHalf = 1e16f;
/// Bound of the relative error with which a place on the square across a ray is known.
constexpr float kRounding = 1e-6f;

Status check_tree(const std::vector<EmissionData::Node>& nodes, size_t cells) {
    if (nodes.empty()) return data_loss("the emission table has no tree of places");
    for (size_t i = 0; i < nodes.size(); ++i) {
        const EmissionData::Node& n = nodes[i];
        if (n.axis() == 3) {
            if (n.child() >= cells) return data_loss("the emission table names a cell that it does not have");
        } else if (n.child() <= i || size_t(n.child()) + 1 >= nodes.size() || !std::isfinite(n.threshold)) {
            return data_loss("the emission table's tree of places is malformed");
        }
    }
    return {};
}

Status check_share(float v, const char* name) {
    if (!(v >= 0 && v <= 1)) return data_loss(std::string("the emission table's ") + name + " is not between 0 and 1");
    return {};
}

}  // namespace

Vec2 sample_square(const std::vector<SquareNode>& nodes, uint32_t root, Vec2 u) {
    if (root == kUniformSquare) return u;
    Vec2 origin{0, 0};
    float size = 1;
    for (uint32_t i = root;;) {
        const SquareNode& n = nodes[i];
        const float left = n.share[0] + n.share[2], total = left + (n.share[1] + n.share[3]);
        int quarter = 0;
        const float x = u.x * total;
        if (x < left) {
            u.x = x / left;
        } else {
            quarter = 1;
            u.x = (x - left) / (total - left);
        }
        const float lower = n.share[quarter], column = lower + n.share[quarter + 2];
        const float y = u.y * column;
        if (y < lower) {
            u.y = y / lower;
        } else {
            u.y = (y - lower) / (column - lower);
            quarter += 2;
        }
        u = {std::fmin(u.x, kBelowOne), std::fmin(u.y, kBelowOne)};
        size *= 0.5f;
        if (quarter & 1) origin.x += size;
        if (quarter & 2) origin.y += size;
        i = n.child[quarter];
        if (i == 0) return {origin.x + u.x * size, origin.y + u.y * size};
    }
}

float square_density(const std::vector<SquareNode>& nodes, uint32_t root, Vec2 p) {
    if (root == kUniformSquare) return 1;
    float density = 1;
    for (uint32_t i = root;;) {
        p = {2 * p.x, 2 * p.y};
        int quarter = 0;
        if (p.x >= 1) quarter += 1, p.x -= 1;
        if (p.y >= 1) quarter += 2, p.y -= 1;
        density *= 4 * nodes[i].share[quarter];
        i = nodes[i].child[quarter];
        if (i == 0) return density;
    }
}

Status EmissionData::validate(size_t emitter_count) const {
    LL_RETURN_IF_ERROR(check_share(power_share, "share of emission by power"));
    LL_RETURN_IF_ERROR(check_share(power_places, "share of places by power"));
    LL_RETURN_IF_ERROR(check_share(power_directions, "share of directions by power"));
    if (power_share < kLeastPowerShare) return data_loss("the emission table keeps less than a tenth of emission by power");
    if (!learned()) return {};
    if (emitters.size() != emitter_count || places.size() != emitter_count)
        return data_loss("the emission table belongs to another scene");
    double sum = 0;
    for (const float p : emitters) {
        if (!(p >= 0 && p <= 1)) return data_loss("the emission table has an emitter's probability outside of 0 to 1");
        sum += double(p);
    }
    if (!(std::fabs(sum - 1) < 1e-3)) return data_loss("the emission table's probabilities of emitters do not sum to one");
    const auto bad_root = [&](uint32_t root) { return root != kUniformSquare && root >= squares.size(); };
    for (const uint32_t root : places)
        if (bad_root(root)) return data_loss("the emission table names a density that it does not have");
    for (const Cell& c : cells) {
        if (bad_root(c.root)) return data_loss("the emission table names a density that it does not have");
        if (!(c.half >= kLeastHalf && c.half <= kMostHalf && std::isfinite(c.pivot.x + c.pivot.y + c.pivot.z)))
            return data_loss("the emission table has a cell whose size or place is out of range");
    }
    LL_RETURN_IF_ERROR(check_tree(finite, cells.size()));
    LL_RETURN_IF_ERROR(check_tree(infinite, cells.size()));
    std::vector<int> level(squares.size(), 1);
    for (size_t i = 0; i < squares.size(); ++i) {
        float total = 0;
        for (int q = 0; q < 4; ++q) {
            const uint32_t child = squares[i].child[q];
            if (!(squares[i].share[q] > 0)) return data_loss("the emission table has a density that is not positive");
            if (child != 0 && (child <= i || child >= squares.size()))
                return data_loss("the emission table's densities are malformed");
            if (child != 0) level[child] = std::max(level[child], level[i] + 1);
            total += squares[i].share[q];
        }
        if (level[i] > kMostLevels) return data_loss("the emission table has a density of too many levels");
        if (!(std::fabs(total - 1) < 1e-5f)) return data_loss("the emission table has a density that does not integrate to one");
    }
    return {};
}

EmissionTable::EmissionTable(EmissionData data) : data_(std::move(data)) {
    const std::vector<double> weights(data_.emitters.begin(), data_.emitters.end());
    if (!weights.empty()) pick_ = AliasTable(weights);
    // Rounding of shares that were read from a file would otherwise multiply from level to level.
    for (SquareNode& n : data_.squares) {
        const double total = double(n.share[0]) + double(n.share[1]) + double(n.share[2]) + double(n.share[3]);
        for (float& share : n.share) share = float(double(share) / total);
    }
}

Vec3 EmissionTable::sample_direction(const Vec3& position, Vec2 u) const {
    return equal_area_square_to_sphere(sample(finite_cell(position).root, u));
}

float EmissionTable::pdf_direction(const Vec3& position, const Vec3& w) const {
    return kInvFourPi * density(finite_cell(position).root, equal_area_sphere_to_square(w));
}

Vec3 EmissionTable::sample_crossing(const Vec3& w, Vec2 u) const {
    const EmissionData::Cell& cell = infinite_cell(w);
    const Vec2 p = sample(cell.root, u);
    const Frame frame(w);
    return cell.pivot + frame.s * ((2 * p.x - 1) * cell.half) + frame.t * ((2 * p.y - 1) * cell.half);
}

float EmissionTable::pdf_crossing(const Vec3& w, const Vec3& point) const {
    const EmissionData::Cell& cell = infinite_cell(w);
    const Frame frame(w);
    const Vec3 d = point - cell.pivot;
    const float width = 2 * cell.half;
    const Vec2 p{dot(d, frame.s) / width + 0.5f, dot(d, frame.t) / width + 0.5f};
    // Rounding takes places at the border across it. By power alone they would have a density that may be millions of times too
    // small, and a sub-path that passes there would be as much too bright.
    const float slack = kRounding * (1 + (length(d) + length(cell.pivot)) / width);
    if (!(p.x >= -slack && p.x < 1 + slack && p.y >= -slack && p.y < 1 + slack)) return 0;
    const Vec2 inside{clamp(p.x, 0.0f, kBelowOne), clamp(p.y, 0.0f, kBelowOne)};
    return density(cell.root, inside) / (width * width);
}

}  // namespace lightloom
