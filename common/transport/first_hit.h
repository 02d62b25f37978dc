#pragma once
// First-hit layers: albedo, shading normal and depth of what the camera sees first, for denoisers and compositing.

#include <vector>

#include "common/film/exr_io.h"
#include "common/scene/scene.h"

namespace lightloom {

/// Layers "albedo" (RGB, in [0, 1]) and "normal" (XYZ, world, unit normals facing the camera), each the mean of
/// `samples` rays per pixel of the crop, where rays that hit nothing count as zero; and "depth" (Z, distance along the
/// ray in scene units), the mean of the rays that hit something, 0 where none does. All threads work on it; the result
/// is a pure function of the arguments.
std::vector<ImageLayer> first_hit_layers(const Scene& scene, uint64_t seed, int samples = 8);

}  // namespace lightloom
