#pragma once
// Where and in which direction light sub-paths should leave the lights, as it was learned from full paths: which
// emitter, where on it, and in which direction, or, for infinite lights, which direction and where on the plane across
// it. EmitterSet mixes it with emission in proportion to power. [Guided emission: Vorba et al. 2014; the
// directional quadtrees: Müller, Gross and Novák 2017; common/path/README.md, "Learned emission"]

#include <cstdint>
#include <vector>

#include "common/core/result.h"
#include "common/core/vec.h"
#include "common/scene/sampling.h"

namespace lightloom {

/// A density on the unit square that is constant on the leaves of quadtrees; many trees share one array of nodes.
struct SquareNode {
    /// Probability of each quarter, the lower left, lower right, upper left and upper right one. All are positive, and
    /// they sum to one.
    float share[4] = {0.25f, 0.25f, 0.25f, 0.25f};
    uint32_t child[4] = {};  ///< Node of each quarter, which follows its parent; 0: the density there is uniform.
};
/// In place of a root: the density is uniform.
inline constexpr uint32_t kUniformSquare = 0xffffffff;

Vec2 sample_square(const std::vector<SquareNode>& nodes, uint32_t root, Vec2 u);
float square_density(const std::vector<SquareNode>& nodes, uint32_t root, Vec2 p);

/// What was learned, as plain arrays.
struct EmissionData {
    /// Share of the sub-paths whose emission, place and direction, is in proportion to power.
    float power_share = 1;
    /// Of the others: the share whose place, and independently the share whose direction, is that of power.
    float power_places = 0, power_directions = 0;
    std::vector<float> emitters;   ///< Probability of every emitter, for the learned places.
    std::vector<uint32_t> places;  ///< By emitter: root of the density over emitter_square(); kUniformSquare: as by power.

    /// A decision tree over places. Inner nodes: axis 0, 1 or 2, and the left child (the right one follows it); leaves:
    /// axis 3 and the number of a cell.
    struct Node {
        float threshold = 0;
        uint32_t axis_and_child = 3u << 30;
        uint32_t axis() const { return axis_and_child >> 30; }
        uint32_t child() const { return axis_and_child & 0x3fffffffu; }
    };
    static Node make_leaf(uint32_t cell) { return {0, 3u << 30 | cell}; }
    static Node make_inner(uint32_t axis, float threshold, uint32_t left) { return {threshold, axis << 30 | left}; }
    std::vector<Node> finite;    ///< Over the positions of points on finite lights.
    std::vector<Node> infinite;  ///< Over the directions in which infinite lights' rays travel.

    /// Directions of finite lights: a density on the sphere, world space, as an equal-area square. Infinite lights: a
    /// density on a square across the direction of travel around `pivot`, 2 `half` wide, and zero outside of it.
    struct Cell {
        uint32_t root = kUniformSquare;
        Vec3 pivot;
        float half = 1;
    };
    std::vector<Cell> cells;
    std::vector<SquareNode> squares;

    /// Checks everything that sampling relies on; kDataLoss names what is wrong.
    Status validate(size_t emitter_count) const;
    /// Whether there is anything but emission by power.
    bool learned() const { return power_share < 1; }
};

/// The least EmissionData::power_share, which bounds what a wrong table can cost.
inline constexpr float kLeastPowerShare = 0.1f;

class EmissionTable {
  public:
    /// The data must be valid.
    explicit EmissionTable(EmissionData data);

    const EmissionData& data() const { return data_; }

    /// Chooses an emitter; `u` in [0, 1), `rest` receives a new uniform number.
    uint32_t pick(double u, float* rest) const { return pick_.sample(u, rest); }
    float probability(uint32_t emitter) const { return pick_.pmf(emitter); }
    uint32_t place(uint32_t emitter) const { return data_.places[emitter]; }
    Vec2 sample(uint32_t root, Vec2 u) const { return sample_square(data_.squares, root, u); }
    float density(uint32_t root, Vec2 p) const { return square_density(data_.squares, root, p); }

    const EmissionData::Cell& finite_cell(const Vec3& position) const { return data_.cells[find(data_.finite, position)]; }
    const EmissionData::Cell& infinite_cell(const Vec3& travel) const { return data_.cells[find(data_.infinite, travel)]; }

    // Directions from a finite light at `position`, density per solid angle.
    Vec3 sample_direction(const Vec3& position, Vec2 u) const;
    float pdf_direction(const Vec3& position, const Vec3& w) const;
    // A point that a ray of an infinite light passes, which travels along `w`; density per area across it. `point` is any
    // point of the ray.
    Vec3 sample_crossing(const Vec3& w, Vec2 u) const;
    float pdf_crossing(const Vec3& w, const Vec3& point) const;

  private:
    static uint32_t find(const std::vector<EmissionData::Node>& nodes, const Vec3& p) {
        uint32_t i = 0;
        for (uint32_t axis = nodes[0].axis(); axis != 3; axis = nodes[i].axis()) {
            const float c = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
            i = nodes[i].child() + (c >= nodes[i].threshold ? 1 : 0);
        }
        return nodes[i].child();
    }

    EmissionData data_;
    AliasTable pick_;
};

}  // namespace lightloom
