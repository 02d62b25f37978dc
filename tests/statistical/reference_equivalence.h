#pragma once
// Means of a picture and of its parts with confidence intervals, from independent group images: what the parts of the
// program `reference_equivalence` share.

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/metrics/region_means.h"
#include "common/metrics/significance.h"
#include "common/scene/scene.h"
#include "common/transport/renderer.h"

namespace lightloom::equivalence {

struct Options {
    std::string shared, json, pictures;
    std::vector<std::string> only, algorithms{"path", "bdpt"};
    double seconds = 60, bound = 0.01, region_bound = 0.05;
    uint64_t seed = 1;
    size_t threads = 0;  ///< 0: all.
    bool light = false, missing = false, spectral = false;
};

/// The parts of a picture whose means are taken: luminance of the whole, of a 3 x 3 grid, and the channels of the whole.
enum Part : int { kImage = 0, kFirstRegion = 1, kFirstChannel = 10, kParts = 13 };
inline nlohmann::ordered_json to_json(const RatioInterval& i) { return {{"ratio", i.ratio}, {"low", i.low}, {"high", i.high}}; }

using PartMeans = std::vector<double>;
PartMeans part_means(const RgbImage& image);

/// Independent group images, reduced to the means of their parts.
struct Rendering {
    std::vector<WeightedMean> parts = std::vector<WeightedMean>(kParts);
    uint64_t iterations = 0, dropped = 0;
    double seconds = 0;
    RgbImage picture;

    Estimate mean(size_t part) const { return parts[part].estimate(); }
};

using RenderGroup = std::function<Result<Partial>(const RenderUnit&)>;
/// Renders groups until `settled` (asked from the 16th group on) or until `seconds` have passed.
Result<Rendering> render_groups(const Scene& scene, const RenderGroup& render, double seconds,
                                const std::function<bool(const Rendering&)>& settled);

struct LoadedScene {
    std::shared_ptr<const Scene> scene;
    int max_depth = 0;
};
/// SHARED/scenes/NAME/scene.pbrt, `resolution` as "WIDTHxHEIGHT". With `hittable_radius` > 0 point lights become spheres of
/// that radius with the same intensity, which a path can hit.
Result<LoadedScene> load_scene(const Options& options, const std::string& name, const std::string& resolution,
                               float hittable_radius = 0);
/// An algorithm of the catalog.
Result<RenderGroup> catalog_group(const LoadedScene& loaded, const std::string& algorithm, uint64_t seed);

/// `light` against the part of `bdpt` that light tracing can make: everything but what the lens sees through a Dirac vertex.
Result<RatioInterval> light_against_bdpt(const Options& options, const LoadedScene& loaded, double level,
                                         nlohmann::ordered_json* line);

/// Prints the energy of paths that no technique of `bdpt` but hitting the emitter can make (specular - diffuse - specular).
Status print_missing_energy(const Options& options);

/// Prints the mean of `path` in RGB over that of `path` in spectra, as pbrt-v4 makes them from RGB: the whole with its standard
/// error, its channels, and nine regions.
Status print_spectral_ratio(const Options& options, const std::string& name, const std::string& resolution);

}  // namespace lightloom::equivalence
