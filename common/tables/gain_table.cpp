#include "common/tables/gain_table.h"

#include <cmath>

namespace lightloom {
namespace {

constexpr int kMostLevels = 64;

}  // namespace

Status GainData::validate() const {
    if (!learned()) {
        if (!brightness.empty() || !gains.empty()) return data_loss("the gain table has gains but no places");
        return {};
    }
    if (blocks_x < 1 || blocks_y < 1 || brightness.size() != size_t(blocks_x) * size_t(blocks_y))
        return data_loss("the gain table has no frame");
    for (const float b : brightness)
        if (!(b > 0 && std::isfinite(b))) return data_loss("the gain table has a block whose brightness is not positive");
    for (const Gain& g : gains)
        if (!(g.keep >= 0 && std::isfinite(g.keep) && g.split >= 0 && std::isfinite(g.split)))
            return data_loss("the gain table has a gain that is negative or not finite");
    std::vector<int> level(nodes.size(), 1);
    for (size_t i = 0; i < nodes.size(); ++i) {
        const uint32_t axis = nodes[i].axis(), child = nodes[i].child();
        if (axis == 7 ? child >= gains.size() : axis > 5 || child <= i || size_t(child) + 1 >= nodes.size())
            return data_loss("the gain table has a malformed tree");
        if (axis == 7) continue;
        if (std::isnan(nodes[i].threshold)) return data_loss("the gain table has a threshold that is no number");
        for (const size_t below : {size_t(child), size_t(child) + 1}) level[below] = std::max(level[below], level[i] + 1);
        if (level[i] >= kMostLevels) return data_loss("the gain table has a tree of too many levels");
    }
    return {};
}

}  // namespace lightloom
