#pragma once
// kappa, the classifier of sub-paths: a decision tree over the end of a sub-path. The label is a function of the end alone, so
// that every technique gives the same prefix or suffix the same label. [Su, Li and Wang 2022, section 5.1; algorithms.md 1.4]

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/core/vec.h"

namespace lightloom {

/// The end of a sub-path of at least two vertices, as its own predecessor sees it.
struct SubPathEnd {
    Vec3 position;
    Vec3 normal;     ///< Unit geometric normal on the predecessor's side.
    Vec3 direction;  ///< Unit, towards the predecessor.
};

inline SubPathEnd sub_path_end(const Vec3& position, const Vec3& geometric_normal, const Vec3& to_predecessor) {
    return {position, face_forward(geometric_normal, to_predecessor), to_predecessor};
}

/// Binary decision tree; immutable once made.
class SubspaceTree {
  public:
    static constexpr uint32_t kAxes = 9;  ///< Position, normal, direction: three scalars each.
    static constexpr uint32_t kLeaf = 15;
    static constexpr uint32_t kMaxDepth = 24;

    /// Axis in the upper four bits; below them the index of the left child (the right one follows it), or the label of a leaf.
    struct Node {
        float threshold = 0;
        uint32_t axis_and_child = kLeaf << 28;
        uint32_t axis() const { return axis_and_child >> 28; }
        uint32_t child() const { return axis_and_child & 0x0fffffffu; }
    };
    static Node make_leaf(uint32_t label) { return {0, (kLeaf << 28) | label}; }
    static Node make_inner(uint32_t axis, float threshold, uint32_t left) { return {threshold, (axis << 28) | left}; }

    /// One leaf: everything has label 0.
    SubspaceTree() : nodes_(1, make_leaf(0)) {}
    /// `nodes[0]` is the root; see validate().
    explicit SubspaceTree(std::vector<Node> nodes) : nodes_(std::move(nodes)) {}

    uint32_t label(const SubPathEnd& end) const {
        const float scalars[kAxes] = {end.position.x, end.position.y,  end.position.z,  end.normal.x, end.normal.y,
                                      end.normal.z,   end.direction.x, end.direction.y, end.direction.z};
        uint32_t i = 0;
        while (nodes_[i].axis() != kLeaf) i = nodes_[i].child() + (scalars[nodes_[i].axis()] >= nodes_[i].threshold ? 1 : 0);
        return nodes_[i].child();
    }
    const std::vector<Node>& nodes() const { return nodes_; }
    /// Children follow their parents (no loop can exist), every index is inside, every label below `label_count`, thresholds
    /// are finite.
    Status validate(uint32_t label_count) const;

  private:
    std::vector<Node> nodes_;
};

}  // namespace lightloom
