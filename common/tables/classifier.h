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
    /// The same function of an end by fewer nodes in a better order: splits between equal leaves are gone, and what one descent
    /// reads lies together on every scale, from cache lines to pages [van Emde Boas's layout; Prokop 1999, chapter 6].
    SubspaceTree compacted() const;

    uint32_t label(const SubPathEnd& end) const { return label(end, 0); }
    /// The same, from a node on the way that settle() returned for an end with this position and normal.
    uint32_t label(const SubPathEnd& end, uint32_t from) const {
        return nodes_[descend(end, from, [](const Node& n) { return n.axis() == kLeaf; })].child();
    }
    /// As far as position and normal alone lead. A vertex is asked for labels from many directions, and two thirds of the way are
    /// the same for all of them.
    uint32_t settle(const Vec3& position, const Vec3& normal) const {
        return descend({position, normal, {}}, 0, [](const Node& n) { return n.axis() >= kFirstDirectionAxis; });
    }
    const std::vector<Node>& nodes() const { return nodes_; }
    /// Children follow their parents (no loop can exist), every index is inside, every label below `label_count`, thresholds
    /// are finite.
    Status validate(uint32_t label_count) const;

  private:
    static constexpr uint32_t kFirstDirectionAxis = 6;

    template <class Stop>
    uint32_t descend(const SubPathEnd& end, uint32_t i, Stop&& stop) const {
        const float scalars[kAxes] = {end.position.x, end.position.y,  end.position.z,  end.normal.x, end.normal.y,
                                      end.normal.z,   end.direction.x, end.direction.y, end.direction.z};
        while (!stop(nodes_[i])) i = nodes_[i].child() + (scalars[nodes_[i].axis()] >= nodes_[i].threshold ? 1 : 0);
        return i;
    }

    std::vector<Node> nodes_;
};

}  // namespace lightloom
