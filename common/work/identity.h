#pragma once
// What this build computes light with, and the golden units that prove it on this host.

#include "common/core/result.h"
#include "common/scene/description.h"
#include "common/work/service.h"

namespace lightloom {

/// Version and digest of all sources under common/, for example "0.1.0+1a2b3c4d5e6f7081".
extern const char* const kBuildId;
/// Compiler and ray tracer with their versions, for example "GNU-12.2.0 embree-3.13.5".
extern const char* const kTools;

/// Compiler, instruction set, contraction, ray tracer with its instruction set.
std::string math_profile();

/// A room with one area light, one diffuse-transmitting curtain and a sphere: enough to reach the camera, both walks, area light
/// sampling, textures and triangle and sphere intersection.
SceneDescription golden_scene();

/// Renders one 32 x 32 unit of the golden scene per algorithm of the catalog and digests the partials. Takes well under a
/// second; the result is a constant of (build, correct host).
Result<Digest> golden_unit_digest();

/// The identity of this process; renders the golden units once.
Result<BuildIdentity> build_identity();

}  // namespace lightloom
