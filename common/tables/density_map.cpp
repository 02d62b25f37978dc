#include "common/tables/density_map.h"

#include <cmath>

namespace lightloom {

Status DensityData::validate() const {
    if (!learned()) {
        if (!densities.empty()) return data_loss("the density map has densities but no cells");
        return {};
    }
    const auto finite = [](float v) { return std::isfinite(v); };
    if (!(side > 0) || !finite(side) || !finite(corner.x) || !finite(corner.y) || !finite(corner.z))
        return data_loss("the density map's root is no cube");
    if (densities.empty() || densities.size() > kMaxDensities)
        return data_loss("the density map has too few or too many densities");
    for (const float d : densities)
        if (!(d > 0) || !finite(d)) return data_loss("the density map has a density that is not positive");
    for (size_t i = 0; i < nodes.size(); ++i) {
        const bool leaf = nodes[i] & kLeaf;
        if (leaf ? (nodes[i] & ~kLeaf) >= densities.size() : nodes[i] <= i || nodes[i] + size_t(8) > nodes.size())
            return data_loss("the density map has a cell that points nowhere");
    }
    return {};
}

}  // namespace lightloom
