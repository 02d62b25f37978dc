#pragma once
// kappa, the classifier of sub-paths: a decision tree over the end of a sub-path. The label is a function of the end alone, so
// that every technique gives the same prefix or suffix the same label. [Su, Li and Wang 2022, section 6.4; common/path/README.md,
// "Classifier"]

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

    /// An end's scalars by axis. There is room for every 4-bit axis, because a descent may look up a leaf's before it
    /// knows that the node is a leaf.
    using Scalars = std::array<float, 16>;
    static Scalars scalars_of(const SubPathEnd& e) {
        return {e.position.x, e.position.y,  e.position.z,  e.normal.x,   e.normal.y,
                e.normal.z,   e.direction.x, e.direction.y, e.direction.z};
    }

    /// Axis in the upper four bits; below them the index of the left child (the right one follows it), or the label of a leaf.
    struct Node {
        float threshold = 0;
        uint32_t axis_and_child = kLeaf << 28;
        uint32_t axis() const { return axis_and_child >> 28; }
        uint32_t child() const { return axis_and_child & 0x0fffffffu; }
        /// The child on the side of the scalars; the node must be an inner one.
        uint32_t next(const Scalars& scalars) const { return child() + (scalars[axis()] >= threshold ? 1 : 0); }
    };
    static Node make_leaf(uint32_t label) { return {0, (kLeaf << 28) | label}; }
    static Node make_inner(uint32_t axis, float threshold, uint32_t left) { return {threshold, (axis << 28) | left}; }

    /// One leaf: everything has label 0.
    SubspaceTree() : nodes_(1, make_leaf(0)) {}
    /// `nodes[0]` is the root; see validate().
    explicit SubspaceTree(std::vector<Node> nodes) : nodes_(std::move(nodes)) {}
    /// Returns a tree that gives every end the same label with fewer nodes in a better order: splits between equal
    /// leaves are removed, and the nodes of one descent lie close together on every scale, from cache lines to pages
    /// [van Emde Boas's layout; Prokop 1999, chapter 6].
    SubspaceTree compacted() const;

    uint32_t label(const SubPathEnd& end) const { return label(end, 0); }
    /// The same label, by a descent from the node that label_and_settle() returned for an end of this position and
    /// normal.
    uint32_t label(const SubPathEnd& end, uint32_t from) const {
        const Scalars scalars = scalars_of(end);
        while (nodes_[from].axis() != kLeaf) from = nodes_[from].next(scalars);
        return nodes_[from].child();
    }
    /// Returns this tree's label, and the node of `other` to which position and normal alone lead: a vertex is asked
    /// for its labels of many directions, and two thirds of those descents are the same. Each step of a descent waits
    /// for the step before it; two descents at once wait together.
    struct Settled {
        uint32_t label, other_branch;
    };
    Settled label_and_settle(const SubPathEnd& end, const SubspaceTree& other) const {
        const Scalars scalars = scalars_of(end);
        for (uint32_t i = 0, j = 0;;) {
            const Node a = nodes_[i], b = other.nodes_[j];
            const bool leaf = a.axis() == kLeaf, settled = b.axis() >= kFirstDirectionAxis;
            if (leaf && settled) return {a.child(), j};
            i = leaf ? i : a.next(scalars);
            j = settled ? j : b.next(scalars);
        }
    }
    const std::vector<Node>& nodes() const { return nodes_; }
    /// One more than the largest label.
    uint32_t label_end() const;
    /// Checks that children follow their parents (so that there is no loop), that every index is in range and every
    /// label below `label_count`, and that thresholds are finite.
    Status validate(uint32_t label_count) const;

  private:
    static constexpr uint32_t kFirstDirectionAxis = 6;

    std::vector<Node> nodes_;
};

}  // namespace lightloom
