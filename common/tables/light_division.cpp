#include "common/tables/light_division.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/scene/emitter_square.h"

namespace lightloom {
namespace {

uint32_t grid_line(float u, uint32_t side) {
    const float scaled = u * float(side);
    return scaled > 0 ? std::min(uint32_t(scaled), side - 1) : 0;
}

}  // namespace

SubPathEnd source_end(const Emitter& e, const Vec3& position) {
    switch (e.kind) {
        case EmitterKind::kTriangle: return {position, e.normal, {}};
        case EmitterKind::kSphere: {
            const Vec3 outward = e.radius > 0 ? (position - e.position) / e.radius : Vec3();
            return {position, e.inward ? -outward : outward, {}};
        }
        case EmitterKind::kSpot: return {e.position, e.normal, {}};
        case EmitterKind::kPoint:
        case EmitterKind::kProjection:
        case EmitterKind::kGoniometric: return {e.position, {}, {}};
        case EmitterKind::kDistant:
        case EmitterKind::kEnvironment: break;  // they have no place
    }
    return {};
}

LightDivision::LightDivision(std::vector<Cells> cells, SubspaceTree finite)
    : cells_(std::move(cells)),
      finite_(std::move(finite)),
      cell_count_(finite_.label_end()) {
    for (const Cells& c : cells_)
        if (c.side > 0) cell_count_ = std::max(cell_count_, uint32_t(c.first) + uint32_t(c.side) * c.side);
}

LightDivision LightDivision::divide(const EmitterSet& emitters, SubspaceTree finite, uint32_t first, uint32_t cell_count) {
    std::vector<Cells> cells(emitters.all().size());
    double total = 0;
    for (const Emitter& e : emitters.all())
        if (e.is_infinite()) total += emitters.power(e);
    // `taken` cells are in use, and the lights in the last one fill `open` of it. A light that would fill less than four
    // cells (2 x 2), or that is a single direction, shares the last cell until it is full.
    uint32_t taken = 0;
    double open = 1;
    for (size_t i = 0; i < cells.size(); ++i) {
        const Emitter& e = emitters[uint32_t(i)];
        if (!e.is_infinite()) continue;
        const double share = total > 0 ? emitters.power(e) / total * cell_count : 0;
        const uint32_t side = has_square(e) ? uint32_t(std::sqrt(share)) : 1;
        if (side >= 2 && taken + side * side <= cell_count) {
            cells[i] = {uint16_t(first + taken), uint16_t(side)};
            taken += side * side;
            open = 1;
            continue;
        }
        if ((open >= 1 && taken < cell_count) || taken == 0) {
            ++taken;
            open = 0;
        }
        cells[i] = {uint16_t(first + taken - 1), 1};
        open += share;
    }
    return {std::move(cells), std::move(finite)};
}

uint32_t LightDivision::label(const EmitterSet& emitters, uint32_t index, const Vec3& position, const Vec3& w) const {
    const Cells& c = cells_[index];
    if (c.side == 0) return finite_.label(source_end(emitters[index], position));
    if (c.side == 1) return c.first;
    const Vec2 u = emitter_square(emitters[index], position, w);
    return c.first + grid_line(u.y, c.side) * c.side + grid_line(u.x, c.side);
}

Status LightDivision::validate(const EmitterSet& emitters, uint32_t label_count) const {
    if (cells_.size() != emitters.all().size()) return data_loss("the light division belongs to another scene");
    for (size_t i = 0; i < cells_.size(); ++i) {
        const Cells& c = cells_[i];
        if ((c.side > 0) != emitters[uint32_t(i)].is_infinite())
            return data_loss("a light's cells are those of another kind of light");
        if (c.side > 0 && uint32_t(c.first) + uint32_t(c.side) * c.side > label_count)
            return data_loss("a light's cells lie beyond the last subspace");
    }
    return finite_.validate(label_count);
}

}  // namespace lightloom
