#pragma once
// The light subspaces of prefixes of a single vertex, x_0, which lies on the light. Points on finite lights have a decision
// tree over position and normal, which is learned from the points that matter (train_division.h). Infinite lights have cells of
// their own: the environment an equal-area grid of directions. [After Su, Li and Wang 2022, section 7.2.1;
// common/path/README.md, "Classifier"]

#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/scene/emitter.h"
#include "common/tables/classifier.h"

namespace lightloom {

/// What the tree reads of x_0 at `position` on the finite emitter `e`: nothing that differs between a point that was sampled
/// and the same point when it was hit. A point of a two-sided lamp belongs to both of its sides.
SubPathEnd source_end(const Emitter& e, const Vec3& position);

class LightDivision {
  public:
    /// The cells of an infinite light, first .. first + side^2 - 1, form a grid. Finite lights have none: side 0.
    struct Cells {
        uint16_t first = 0, side = 0;
    };

    LightDivision() = default;
    /// `cells` has an entry for every emitter; `finite` gives the labels of the finite ones. Labels may coincide.
    LightDivision(std::vector<Cells> cells, SubspaceTree finite);
    /// Divides the infinite ones of `emitters` into at most `cell_count` cells (at least one if there are any), numbered
    /// from `first`, in proportion to their power: weak lights share a cell.
    static LightDivision divide(const EmitterSet& emitters, SubspaceTree finite, uint32_t first, uint32_t cell_count);
    /// The division into one subspace, 0.
    static LightDivision whole(const EmitterSet& emitters) { return divide(emitters, {}, 0, 1); }

    /// Label of a point x_0 of emitter `index` that emits along `w` (unit; it matters for the environment only). A point
    /// that was sampled and one that was hit have the same label.
    uint32_t label(const EmitterSet& emitters, uint32_t index, const Vec3& position, const Vec3& w) const;
    /// Labels are below this.
    uint32_t cell_count() const { return cell_count_; }
    const std::vector<Cells>& cells() const { return cells_; }
    const SubspaceTree& finite() const { return finite_; }
    /// kDataLoss for a division of other emitters, for labels from `label_count` on, and for what SubspaceTree::validate()
    /// refuses.
    Status validate(const EmitterSet& emitters, uint32_t label_count) const;

  private:
    std::vector<Cells> cells_;
    SubspaceTree finite_;
    uint32_t cell_count_ = 1;
};

}  // namespace lightloom
