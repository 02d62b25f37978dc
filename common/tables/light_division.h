#pragma once
// The light subspaces of prefixes of a single vertex, x_0, which lies on the light. Emitters share a fixed number of
// cells in proportion to their power: an area light gets a grid on its surface, the environment an equal-area grid of
// directions, and weak lights share a cell with their neighbours in the list. [Su, Li and Wang 2022, section 7.2.1: 20 %
// of the light subspaces]

#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/scene/emitter.h"

namespace lightloom {

class LightDivision {
  public:
    /// The cells of an emitter, first .. first + side^2 - 1, form a grid.
    struct Cells {
        uint16_t first = 0, side = 1;
    };

    LightDivision() = default;
    explicit LightDivision(std::vector<Cells> cells) : cells_(std::move(cells)) {}
    /// Divides `emitters` into at most `cell_count` cells (at least one), numbered from zero.
    static LightDivision divide(const EmitterSet& emitters, uint32_t cell_count);

    /// Cell of a point x_0 of emitter `index` that emits along `w` (unit; it matters for the environment only). A point
    /// that was sampled and one that was hit have the same cell.
    uint32_t label(const EmitterSet& emitters, uint32_t index, const Vec3& position, const Vec3& w) const;
    uint32_t cell_count() const;
    const std::vector<Cells>& cells() const { return cells_; }
    Status validate(const EmitterSet& emitters, uint32_t label_count) const;

  private:
    std::vector<Cells> cells_;  // one per emitter
};

}  // namespace lightloom
