#pragma once
// PathView: everything that a weight may know about a full path x_0 (light) ... x_k (camera), the same whichever technique
// produced the path. [common/path/README.md, "Notation" and "The weight": C(s), A(s), effective densities]

#include <cstdint>

#include "common/core/vec.h"

namespace lightloom {

/// Longest path, in edges. A scene that asks for more is refused.
inline constexpr int kMaxEdges = 256;

struct PathView {
    int k = 0;  ///< Edges; k + 1 vertices. Entries 0 .. k-1 of the arrays are valid.
    /// Density of x_i when traced from the light: pL[0] native measure of the emitter with its pmf, otherwise area (m^-2).
    /// At a vertex that scattered by a Dirac lobe the next density is discrete pmf times the same geometry.
    double fwd[kMaxEdges + 1];
    /// Density of x_i when traced from the camera: pE[k-1] is the camera's density of the primary vertex for one pixel.
    double rev[kMaxEdges + 1];
    /// x_i's scattering event is a Dirac lobe (0 < i < k); false at both ends.
    bool delta[kMaxEdges + 1];
    bool lossless[kMaxEdges + 1];  ///< SubPathVertex::lossless of x_i, 0 < i < k.
    /// What follows is filled in by ViewDetail::kSubspace only (connect.h) and, where marked *, by SubspaceLabeller::complete().
    /// F(1) / C(1) and F(2) / C(2) of the light prefixes of one and two vertices: throughput without Russian roulette.
    Rgb start[2];
    /// step[i], 1 <= i <= k-2: F(i+2) / C(i+2) = step[i] * F(i+1) / C(i+1), channel by channel.
    Rgb step[kMaxEdges + 1];
    /// Scalar of F(s) / C(s), s = 1 .. k-1.
    double light_throughput[kMaxEdges + 1];
    uint16_t light_label[kMaxEdges + 1];  ///< * Light subspace of the prefix x_0 .. x_{s-1}.
    uint16_t eye_label[kMaxEdges + 1];    ///< * Eye subspace of the suffix x_s .. x_k.
    double primary_distance2 = 0;         ///< * |x_k - x_{k-1}|^2; see view_footprint().
    enum class Source : uint8_t { kArea, kDirection, kDiscrete } source = Source::kArea;  ///< * Measure of fwd[0].
    /// Density of x_0 under next event estimation from x_1, native measure, pmf included.
    double next_event = 0;
    /// Of algorithms that merge only: squared distance that the radius of merges is in proportion to; see VcmMethod::complete().
    double footprint_distance2 = 0;
    /// Where they were asked for (VcmMethod::complete()): photons per light sub-path and square metre at x_i, 1 <= i < k, as a
    /// density map has them; and |x_{i+1} - x_i|, m, 0 <= i < k, 0 where x_0 is outside the scene.
    float photons[kMaxEdges + 1];
    float edge[kMaxEdges + 1];
    bool discrete_source = false;  ///< x_0 is one of countably many: fwd[0] and next_event are probabilities.
};

}  // namespace lightloom
