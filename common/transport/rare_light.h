#pragma once
// Estimates how much light an algorithm finds by chance only, before it has found any.
//
// Where every edge of a path begins or ends at a mirror or at smooth glass, nothing can be connected, and only a camera
// sub-path that hits the emitter by itself makes the path: light - specular - diffuse - specular - camera for
// bidirectional algorithms, light - specular - anything - camera for `path`. Few samples hit a small lamp, and their
// values are large. Their number can be estimated beforehand: light sub-paths that reach a surface through mirrors and
// glass alone leave photons there, camera sub-paths search for photons within a radius, and each pair gives the energy
// of a path (density estimation [Jensen 1996]) and the value that the camera sample would have if it went on to the
// lamp. The estimate is biased by its radius and accurate to some ten per cent, which is enough for a message to the
// user; it never enters an image.

#include <stop_token>

#include "common/film/rare_light.h"
#include "common/scene/scene.h"
#include "common/transport/settings.h"

namespace lightloom {

/// The estimate is a pure function of scene and settings; all threads work on it, for a tenth of a second where there
/// is glass and a few milliseconds where there is none. It is empty (RareLight::known() is false) for algorithms
/// without camera sub-paths, which find nothing by chance, for those that merge, which need no chance, and after a stop request.
RareLight estimate_rare_light(const Scene& scene, const RenderSettings& settings, std::stop_token stop = {});

}  // namespace lightloom
