#pragma once
// The parameters of merging, the same in every algorithm that merges, and how their values are read.

#include "common/scene/scene.h"
#include "common/transport/merging.h"
#include "common/transport/parameters.h"

namespace lightloom {

inline constexpr std::string_view kRadiusUnits[] = {"pixel", "scene"};
inline constexpr std::string_view kKernels[] = {"constant", "epanechnikov"};

constexpr ParameterInfo merge_radius_parameter(double standard) {
    return {"merge-radius", standard,
            1e-3,           1000,
            false,          "radius of merges in the first iteration, in the unit of merge-radius-unit [Georgiev et al. 2012]"};
}
/// One pixel is the footprint of Georgiev et al.'s and Grittmann et al.'s programs, too.
inline constexpr ParameterInfo kMergeRadius = merge_radius_parameter(1);
inline constexpr ParameterInfo kMergeRadiusUnit{
    "merge-radius-unit",
    0,
    0,
    1,
    true,
    "pixel: the width of a pixel where the camera sub-path first meets something that is "
    "neither mirror nor glass; scene: a thousandth of the radius of the scene",
    kRadiusUnits};
inline constexpr ParameterInfo kAlpha{
    "alpha",
    0.75,
    0.01,
    1,
    false,
    "how the radius shrinks: its square is in proportion to the number of the iteration to the power of alpha - 1; 1 keeps "
    "it as it is [Knaus and Zwicker 2011]"};
inline constexpr ParameterInfo kMergeFirst{
    "merge-first",
    0,
    0,
    1,
    true,
    "merge at the camera's first hit, too, where light tracing finds the same light without bias [off in Grittmann et al. 2021]",
    kSwitch};
inline constexpr ParameterInfo kKernel{"kernel", 0, 0, 1, true, "weight of a photon by its distance from the camera vertex",
                                       kKernels};
/// For algorithms that merge if they are asked to; the parameters above mean nothing without.
inline constexpr ParameterInfo kMerging{
    "merging",
    0,
    0,
    1,
    true,
    "the light sub-paths of the cache are photons, too, which camera vertices merge with; units "
    "are then whole frames [Georgiev et al. 2012; own combination]",
    kSwitch};
inline bool merging_on(const AlgorithmSettings& s) { return s.has(kMerging.name) && s.value(kMerging.name) != 0; }

/// The radius of the first iteration.
inline MergeRadius merge_radius_of(const AlgorithmSettings& s, const Scene& scene) {
    const double value = s.value(kMergeRadius.name), scene_radius = double(scene.emitters().scene_radius());
    MergeRadius radius{.most2 = scene_radius * scene_radius};
    const FrameLayout& frame = scene.frame();
    if (s.value(kMergeRadiusUnit.name) != 0) {
        radius.fixed2 = value * value * radius.most2 * 1e-6;
        return radius;
    }
    const float centre_density =
        scene.camera().sample_ray({0.5f * float(frame.width), 0.5f * float(frame.height)}, {0.5f, 0.5f}).pdf;
    (scene.camera().has_parallel_rays() ? radius.fixed2 : radius.per_distance2) = value * value / double(centre_density);
    return radius;
}

/// The terms of the first iteration with `paths` light sub-paths; see MergeTerms.
inline MergeTerms merge_terms_of(const AlgorithmSettings& s, const Scene& scene, double paths) {
    return {paths, merge_radius_of(s, scene), MergeKernel(int(s.value(kKernel.name))), s.value(kMergeFirst.name) != 0};
}

}  // namespace lightloom
