#pragma once
// What `lightloom replay --paths` says of the contributions of one sample: how each path was made, its vertices, densities and
// weight. As text for people and as JSON for programs.

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/vec.h"
#include "common/film/response.h"
#include "common/transport/renderer.h"

namespace lightloom::client {

/// A vertex x_i of a full path x_0 (on the light) ... x_k (on the lens).
struct ReportedVertex {
    /// What scatters there, in words; at x_0 which kind of emitter, at x_k "lens". "not resolved" at the end of a camera sub-path
    /// that could not go on.
    std::string_view kind;
    Vec3 position;         ///< For an infinite light a point outside of the scene.
    Vec3 normal;           ///< Geometric; zero at the lens, and for an infinite light the direction of travel.
    int64_t emitter = -1;  ///< Number of the emitter that it lies on; -1: none.
    bool dirac = false;    ///< The path goes on through a Dirac lobe here: no technique connects or merges at it.
    float survival = 1;    ///< What roulette has divided its own sub-path by so far.
    Rgb throughput;        ///< Of its own sub-path up to here, divided by `survival`, before the vertex scatters.
    double fwd = 0;        ///< Density when traced from the light: m^-2, x_0 in the emitter's own measure. NaN at the lens.
    double rev = 0;        ///< The same traced from the camera.
    int light_label = -1;  ///< Light subspace of the prefix x_0 ... x_i; -1: the algorithm gives none.
    int eye_label = -1;    ///< Eye subspace of the suffix x_i ... x_k.
};

/// A contribution, with values that outlive the renderer's.
struct ReportedPath {
    Technique technique;
    int k = 0, t = 0;  ///< Edges; camera vertices.
    std::vector<ReportedVertex> vertices;
    std::string_view source_measure;  ///< Of the densities of x_0: "area", "solid angle" or "discrete".
    double next_event = 0;            ///< Density of x_0 if it were chosen from x_1, in that measure; NaN for k = 1.
    float survival = 1;               ///< Of both sub-paths together.
    Rgb throughput;                   ///< Of both sub-paths together, before they were completed to a path.
    Rgb value;                        ///< Unweighted.
    float weight = 0;
    Rgb weighted;            ///< What the image gets.
    int x = 0, y = 0;        ///< Full-frame pixel in which it lands.
    uint64_t iteration = 0;  ///< Of a splat from a cache the batch's first.
};

ReportedPath report_path(const Scene& scene, const SeenContribution& seen);

/// Everything that is printed of one sample.
struct SampleReport {
    std::string algorithm;
    uint64_t iteration = 0;
    int x = 0, y = 0;
    uint32_t group = 0, tile = 0;  ///< The unit that it belongs to.
    FilmResponse response;         ///< Of the film; printed values are what it makes of them.
    std::array<double, 3> camera{};
    uint64_t dropped = 0;
    /// Contributions to the sample, in the order in which they are added. `splats`: of its own light path or, where the light
    /// paths are the unit's, what of these lands in the pixel.
    std::vector<ReportedPath> paths, splats;
    bool splats_of_unit = false;   ///< The light paths are the unit's...
    bool splats_left_out = false;  ///< ...and nobody asked for them.

    /// Of the weighted values in that order, in the renderer's arithmetic: equal to `camera` to the last bit unless the sample was
    /// dropped.
    std::array<double, 3> sum() const;
};

std::string to_text(const SampleReport& report);
/// One document, described by kPathSchema.
std::string to_json(const SampleReport& report);

/// For --help.
inline constexpr const char* kPathSchema =
    R"(--paths --json prints one JSON document; numbers that do not exist or are not finite are null:
  algorithm, iteration, pixel [x,y], unit [group,tile], exposure_scale, colour_matrix, dropped
  camera, sum       [r,g,b]: the sample's value, and weight x value of `paths` added in order; equal unless it was dropped
  paths, splats     contributions to the sample; to other pixels too, by its own light path (or, with --splats, to this pixel
                    by the unit's light paths). A splat counts as one light path's, `camera` as one camera sample's. Each has
    technique       hit, next event, connect, lens or merge
    s, t, k         light vertices (merge: index of the vertex where both met), camera vertices, edges
    pixel           where it lands
    iteration       of the sample; for a unit's light path its batch's first
    value           [r,g,b] unweighted: f over the density of what was drawn
    weight          of multiple importance sampling
    weighted        [r,g,b] weight x value: what the image gets
    throughput      [r,g,b] of both sub-paths before they were completed
    survival        what roulette has divided value and throughput by: probabilities, or expected numbers of branches
    source_measure  area, solid angle or discrete: of fwd, rev and next_event at x_0
    next_event      density of x_0 if chosen from x_1
    vertices        x_0 on the light ... x_k on the lens. Each has
      kind          emitter, material or lens
      position, normal (geometric), emitter (number or null), dirac, survival, throughput (of its own sub-path)
      fwd, rev      density when traced from the light and from the camera, per area (m^-2); behind a Dirac vertex the
                    discrete probability of its lobe takes the place of the density of its direction
      light_label, eye_label   subspaces of x_0 ... x_i and of x_i ... x_k, where the algorithm has them)";

}  // namespace lightloom::client
