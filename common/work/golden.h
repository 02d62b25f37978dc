#pragma once
// Scenes whose units prove that a host computes light as the others do.

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

/// A room with one area light, one diffuse-transmitting curtain, metal and glass: easy to connect.
SceneDescription golden_scene();

/// A courtyard with what the room lacks: environments (an image and a constant one), point, spot and distant lights, a
/// sphere that shines, a two-sided light, instances, cut-outs, interpolated normals, image textures, coats, rough
/// glass, a pane, a mix of materials and a thin lens. Each of its materials, lights and shapes influences the bytes of
/// its unit (work_test).
SceneDescription golden_courtyard();

/// Renders one 32 x 32 unit of each scene per algorithm of the catalog, with the tables that it needs, and digests
/// tables and partials. This takes 0.2 s of processor time; the result is the same on every correct host with the same build.
Result<Digest> golden_unit_digest();
/// How often this process has begun to do so, for tests.
uint64_t golden_unit_digests_made();

}  // namespace lightloom
