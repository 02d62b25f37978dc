#include "common/tables/classifier.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lightloom {
namespace {

using Node = SubspaceTree::Node;

/// Reorders a tree: the nodes of the upper half of its levels come first, then the subtrees below, each in the same
/// order.
class Layout {
  public:
    explicit Layout(const std::vector<Node>& from) : from_(from), out_{from[0]} {}

    std::vector<Node> run() {
        std::vector<uint32_t> rest{0};
        while (!rest.empty()) rest = place(rest, SubspaceTree::kMaxDepth);
        return std::move(out_);
    }

  private:
    /// Places the nodes below `tops` (positions in out_) tree by tree; returns the nodes that lie `height` levels
    /// deeper.
    std::vector<uint32_t> place(const std::vector<uint32_t>& tops, uint32_t height) {
        std::vector<uint32_t> bottoms;
        for (const uint32_t top : tops) {
            if (out_[top].axis() == SubspaceTree::kLeaf) continue;
            if (height == 1) {
                const uint32_t child = uint32_t(out_.size()), was = out_[top].child();
                out_[top] = SubspaceTree::make_inner(out_[top].axis(), out_[top].threshold, child);
                out_.push_back(from_[was]), out_.push_back(from_[was + 1]);
                bottoms.push_back(child), bottoms.push_back(child + 1);
            } else {
                const std::vector<uint32_t> below = place(place({top}, height / 2), height - height / 2);
                bottoms.insert(bottoms.end(), below.begin(), below.end());
            }
        }
        return bottoms;
    }

    const std::vector<Node>& from_;
    std::vector<Node> out_;  ///< Its inner nodes point into from_ until their children have places.
};

}  // namespace

SubspaceTree SubspaceTree::compacted() const {
    std::vector<Node> nodes = nodes_;
    for (size_t i = nodes.size(); i-- > 0;) {  // children follow their parents
        if (nodes[i].axis() == kLeaf) continue;
        const Node &left = nodes[nodes[i].child()], &right = nodes[nodes[i].child() + 1];
        if (left.axis() == kLeaf && right.axis() == kLeaf && left.child() == right.child()) nodes[i] = left;
    }
    return SubspaceTree(Layout(nodes).run());
}

uint32_t SubspaceTree::label_end() const {
    uint32_t end = 0;
    for (const Node& n : nodes_)
        if (n.axis() == kLeaf) end = std::max(end, n.child() + 1);
    return end;
}

Status SubspaceTree::validate(uint32_t label_count) const {
    if (nodes_.empty()) return data_loss("a classifier has no nodes");
    for (size_t i = 0; i < nodes_.size(); ++i) {
        const Node& n = nodes_[i];
        if (n.axis() == kLeaf) {
            if (n.child() >= label_count) return data_loss("a classifier's leaf has a label beyond the last subspace");
        } else if (n.axis() >= kAxes || !std::isfinite(n.threshold) || n.child() <= i || n.child() + 1 >= nodes_.size()) {
            return data_loss("a classifier's node is malformed");
        }
    }
    return {};
}

}  // namespace lightloom
