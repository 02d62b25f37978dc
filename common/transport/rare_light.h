#pragma once
// How much light an algorithm finds by chance only, before it has found it.
//
// Where every edge of a path begins or ends at a mirror or at smooth glass, nothing can be connected, and only a camera sub-path
// that hits the emitter by itself makes the path: light - specular - diffuse - specular - camera for bidirectional algorithms,
// light - specular - anything - camera for `path`. A small lamp is hit by few samples of a great value. How many there will be is
// known beforehand: light sub-paths that reach a surface through mirrors and glass alone are photons there, camera sub-paths look
// for them within a radius, and each pair gives the energy of a path (density estimation [Jensen 1996]) and the value that the
// camera sample would bring if it went on to the lamp. The estimate is biased by its radius and known to some ten per cent, which
// is enough for a word to the user; it never enters an image.

#include <stop_token>

#include "common/film/rare_light.h"
#include "common/scene/scene.h"
#include "common/transport/settings.h"

namespace lightloom {

/// A pure function of scene and settings, on all threads; a tenth of a second where there is glass, a few milliseconds where there
/// is none. Nothing (RareLight::known() is false) for algorithms without camera sub-paths, whose gaps no chance fills, and when
/// stopped.
RareLight estimate_rare_light(const Scene& scene, const RenderSettings& settings, std::stop_token stop = {});

}  // namespace lightloom
