#pragma once
// Tables of SPCBPT without any knowledge: random classifiers, random Q, random Gamma, random windows. No image's mean
// may depend on them.

#include <cmath>

#include "common/core/rng.h"
#include "common/tables/subspace_tables.h"

namespace lightloom::testing {

struct RandomTableOptions {
    uint32_t light_count = 12, eye_count = 9;
    uint32_t source_cells = 4;  ///< Upper bound of the cells of lights.
    uint32_t tree_leaves = 40;
    int max_window = 1;
    double spread = 6;  ///< Q and Gamma range over exp(spread).
    Vec3 low{-2, -1, -2}, high{2, 3, 2};
};

/// A classifier of random splits; several leaves share a label.
inline SubspaceTree random_tree(Rng& rng, uint32_t leaves, uint32_t label_count, const RandomTableOptions& options) {
    std::vector<SubspaceTree::Node> nodes(1, SubspaceTree::make_leaf(0));
    std::vector<uint32_t> open{0};
    for (uint32_t made = 1; made < leaves; ++made) {
        const size_t pick = rng.below(uint32_t(open.size()));
        const uint32_t node = open[pick], left = uint32_t(nodes.size()), axis = rng.below(SubspaceTree::kAxes);
        const float u = rng.uniform();
        const float threshold =
            axis < 3 ? options.low[int(axis)] + u * (options.high[int(axis)] - options.low[int(axis)]) : 2 * u - 1;
        nodes[node] = SubspaceTree::make_inner(axis, threshold, left);
        nodes.resize(nodes.size() + 2);
        open[pick] = left;
        open.push_back(left + 1);
    }
    for (SubspaceTree::Node& n : nodes)
        if (n.axis() == SubspaceTree::kLeaf) n = SubspaceTree::make_leaf(rng.below(label_count));
    return SubspaceTree(std::move(nodes));
}

/// Tables that are valid for the emitters; labels of points on lights and of longer prefixes may coincide, which the
/// contract of kappa allows.
inline SubspaceTables random_tables(const EmitterSet& emitters, uint64_t seed, const RandomTableOptions& options = {}) {
    Rng rng({seed, Stage::kTraining, 77, 0});
    const auto positive = [&] { return std::exp(options.spread * (rng.uniform_double() - 0.5)); };
    SubspaceTables t;
    t.light_count = options.light_count, t.eye_count = options.eye_count;
    const uint32_t cells = std::min(options.source_cells, options.light_count);
    Rng division_rng({seed, Stage::kTraining, 78, 0});
    std::vector<LightDivision::Cells> grids;
    for (const Emitter& e : emitters.all()) {
        const uint32_t side = e.is_infinite() ? 1 + division_rng.below(uint32_t(std::sqrt(double(cells)))) : 0;
        const uint32_t first = side > 0 ? division_rng.below(cells - side * side + 1) : 0;
        grids.push_back({uint16_t(first), uint16_t(side)});
    }
    t.division = LightDivision(std::move(grids), random_tree(division_rng, options.tree_leaves, cells, options));
    t.light_tree = random_tree(rng, options.tree_leaves, t.light_count, options);
    t.eye_tree = random_tree(rng, options.tree_leaves, t.eye_count, options);
    for (uint32_t i = 0; i < t.light_count; ++i) {
        t.energy.push_back(float(positive()));
        t.window.push_back(uint16_t(1 + rng.below(uint32_t(options.max_window))));
    }
    for (uint32_t j = 0; j < t.eye_count; ++j) {
        std::vector<double> column;
        double sum = 0;
        for (uint32_t i = 0; i < t.light_count; ++i) column.push_back(positive()), sum += column.back();
        for (const double g : column) t.gamma.push_back(float(g / sum));
    }
    t.vertices_per_path = 0.3 + 5 * rng.uniform_double();
    return t;
}

}  // namespace lightloom::testing
