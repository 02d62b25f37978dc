#pragma once
// What the benchmarks of light transport work on, made once with fixed seeds, on first use: a scene of the repository with its
// tables, a light-vertex cache, camera and light sub-paths. A benchmark's iteration is a pass over a fixed set of these, so that
// two builds do the same work.

#include <memory>
#include <vector>

#include "common/transport/spcbpt.h"

namespace lightloom::bench {

/// Camera sub-paths of pixels that are spread over the frame, or light sub-paths: traced with the default roulette, labelled.
using SubPaths = std::vector<std::vector<PathVertex>>;

/// A camera vertex z[t - 1] that can be connected.
struct CameraVertex {
    const std::vector<PathVertex>* z;
    int t;
};
/// A prefix that a camera vertex has drawn.
struct DrawnPair {
    CameraVertex camera;
    LightPick pick;
};

struct Inputs {
    std::shared_ptr<const Scene> scene;
    int max_edges;
    Tables tables;  ///< Of `spcbpt`, trained with few paths.
    SpcbptAlgorithm<> algorithm;
    SpcbptAlgorithm<>::State state;  ///< A unit's light-vertex cache and its index.
    SubPaths camera_paths, light_paths;
    std::vector<CameraVertex> camera_vertices;
    std::vector<DrawnPair> pairs;  ///< All draws of all camera vertices.
};

/// Ends the program with one line where the scene cannot be read.
const Inputs& inputs();

/// A furnished room with diffuse, coated, metal and glass surfaces, few of which see a light: what learning algorithms are for.
inline constexpr const char* kScene = LIGHTLOOM_SOURCE_DIR "/tests/scenes/quickstart.pbrt";
inline constexpr uint64_t kSeed = 1;
inline constexpr int kPaths = 2048;

/// The n-th camera sample of the benchmarks; see SubPaths.
struct CameraSample {
    uint64_t pixel;
    int px, py;
};
CameraSample camera_sample(const Scene& scene, int n);

}  // namespace lightloom::bench
