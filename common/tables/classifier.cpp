#include "common/tables/classifier.h"

#include <cmath>

namespace lightloom {

Status SubspaceTree::validate(uint32_t label_count) const {
    if (nodes_.empty()) return data_loss("a classifier without nodes");
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
