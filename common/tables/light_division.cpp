#include "common/tables/light_division.h"

#include <algorithm>
#include <cmath>

#include "common/scene/emitter_square.h"

namespace lightloom {
namespace {

uint32_t grid_line(float u, uint32_t side) {
    const float scaled = u * float(side);
    return scaled > 0 ? std::min(uint32_t(scaled), side - 1) : 0;
}

}  // namespace

LightDivision LightDivision::divide(const EmitterSet& emitters, uint32_t cell_count) {
    std::vector<double> power;
    double total = 0;
    for (const Emitter& e : emitters.all()) {
        power.push_back(emitters.power(e));
        total += power.back();
    }
    std::vector<Cells> cells(power.size());
    if (!(total > 0)) return LightDivision(std::move(cells));
    // `taken` cells are in use, and the lights in the last one fill `open` of it. A light that would fill less than four
    // cells (2 x 2), or that has no surface, shares the last cell until it is full.
    uint32_t taken = 0;
    double open = 1;
    for (size_t i = 0; i < cells.size(); ++i) {
        const double share = power[i] / total * cell_count;
        const Emitter& e = emitters[uint32_t(i)];
        const bool has_surface = e.is_area() || e.kind == EmitterKind::kEnvironment;
        const uint32_t side = has_surface ? uint32_t(std::sqrt(share)) : 1;
        if (side >= 2 && taken + side * side <= cell_count) {
            cells[i] = {uint16_t(taken), uint16_t(side)};
            taken += side * side;
            open = 1;
            continue;
        }
        if ((open >= 1 && taken < cell_count) || taken == 0) {
            ++taken;
            open = 0;
        }
        cells[i] = {uint16_t(taken - 1), 1};
        open += share;
    }
    return LightDivision(std::move(cells));
}

uint32_t LightDivision::label(const EmitterSet& emitters, uint32_t index, const Vec3& position, const Vec3& w) const {
    const Cells& c = cells_[index];
    if (c.side == 1) return c.first;
    const Vec2 u = emitter_square(emitters[index], position, w);
    return c.first + grid_line(u.y, c.side) * c.side + grid_line(u.x, c.side);
}

uint32_t LightDivision::cell_count() const {
    uint32_t count = 0;
    for (const Cells& c : cells_) count = std::max(count, uint32_t(c.first) + uint32_t(c.side) * c.side);
    return count;
}

Status LightDivision::validate(const EmitterSet& emitters, uint32_t label_count) const {
    if (cells_.size() != emitters.all().size()) return data_loss("the light division belongs to another scene");
    for (const Cells& c : cells_) {
        if (c.side == 0 || uint32_t(c.first) + uint32_t(c.side) * c.side > label_count)
            return data_loss("a light's cells lie beyond the last subspace");
    }
    return {};
}

}  // namespace lightloom
