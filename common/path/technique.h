#pragma once
// The ways in which a path can be made, by name. Two of them may share a split of the path (next event estimation and a
// cached point on a light both leave one light vertex), so that the number of light vertices alone does not identify a
// technique.

#include <cstdint>
#include <string_view>

namespace lightloom {

enum class TechniqueKind : uint8_t {
    kHit,        ///< s = 0: the camera sub-path hits an emitter or leaves for the sky.
    kNextEvent,  ///< s = 1: x_0 is chosen afresh from x_1.
    kConnect,    ///< 1 <= s <= k - 1: a light sub-path's x_{s-1} is connected to x_s.
    kLens,       ///< s = k: a light sub-path's last vertex is connected to the lens.
    kMerge,      ///< Both sub-paths met at x_i, 1 <= i <= k - 1.
};
inline constexpr int kTechniqueKinds = 5;

/// Lower-case words, for reports and files.
constexpr std::string_view to_string(TechniqueKind kind) {
    constexpr std::string_view kNames[] = {"hit", "next event", "connect", "lens", "merge"};
    return kNames[int(kind)];
}

struct Technique {
    TechniqueKind kind = TechniqueKind::kHit;
    /// The number of light vertices; of a merge the index i of the vertex at which both sub-paths met.
    int s = 0;

    static constexpr Technique hit() { return {TechniqueKind::kHit, 0}; }
    static constexpr Technique next_event() { return {TechniqueKind::kNextEvent, 1}; }
    static constexpr Technique connect(int s) { return {TechniqueKind::kConnect, s}; }
    static constexpr Technique lens(int k) { return {TechniqueKind::kLens, k}; }
    static constexpr Technique merge(int i) { return {TechniqueKind::kMerge, i}; }

    /// Vertices of the light sub-path; of a merge, including the one at which it met the camera sub-path.
    constexpr int light_vertices() const { return kind == TechniqueKind::kMerge ? s + 1 : s; }
    /// Whether the contribution may land in any pixel, because no camera sub-path decided which.
    constexpr bool splats() const { return kind == TechniqueKind::kLens; }

    friend constexpr bool operator==(const Technique&, const Technique&) = default;
};

}  // namespace lightloom
