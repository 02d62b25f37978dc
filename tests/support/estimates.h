#pragma once
// Independent replications of renders, reduced to the means of a few regions, and their comparison.

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <sstream>

#include "common/transport/bdpt.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"
#include "common/transport/unit_loop.h"
#include "tests/support/statistics.h"

namespace lightloom::testing {

/// One number per pixel of the crop, the mean of the channels: the image that one unit alone would
/// make.
inline std::vector<double> develop(const Partial& partial, const Rect& crop) {
    std::vector<double> image(size_t(crop.area()), 0.0);
    const auto scalar = [](const double* v) { return (v[0] + v[1] + v[2]) / 3; };
    for (int64_t i = 0; i < partial.tile.area() && partial.samples_per_pixel > 0; ++i) {
        const int x = partial.tile.x0 + int(i % partial.tile.width()), y = partial.tile.y0 + int(i / partial.tile.width());
        image[size_t(crop.index(x, y))] += scalar(&partial.camera[size_t(3 * i)]) / partial.samples_per_pixel;
    }
    for (const SplatSum& s : partial.splats) image[s.pixel] += scalar(s.rgb.data()) / double(partial.light_paths);
    return image;
}

/// Settings from text, as a user would write them; throws the catalog's error if they are invalid.
inline RenderSettings settings_of(const std::string& algorithm, const std::map<std::string, std::string>& parameters = {},
                                  uint64_t seed = 0, int max_depth = 5) {
    auto settings = AlgorithmSettings::parse(algorithm, parameters);
    if (!settings.ok()) throw std::runtime_error(settings.status().message());
    return {*std::move(settings), seed, max_depth};
}

/// A unit of the whole frame with the given number of light paths per iteration.
inline RenderUnit whole_frame(const Scene& scene, uint32_t iterations, uint64_t light_paths_per_iteration) {
    return {.iteration_count = iterations, .tile = scene.frame().crop, .light_path_count = iterations * light_paths_per_iteration};
}
/// The unit that the algorithm's plan would make.
inline RenderUnit whole_frame(const Scene& scene, const AlgorithmSettings& algorithm, uint32_t iterations) {
    RenderUnit unit = whole_frame(scene, iterations, algorithm.light_paths_per_iteration(scene.frame().crop.area()));
    unit.splats_only = !algorithm.info().camera_samples;
    return unit;
}

/// Those of the parameters that the algorithm has.
inline std::map<std::string, std::string> those_of(const std::string& algorithm, std::map<std::string, std::string> parameters) {
    const AlgorithmSettings row = settings_of(algorithm).algorithm;
    std::erase_if(parameters, [&](const auto& p) { return !row.has(p.first); });
    return parameters;
}

/// Training and caches that suit 32 x 32 pixels, for the rows of the catalog that have them; parameters that are
/// already set stay. Emission is learned. Merges have a radius at which their bias cannot be seen.
inline std::map<std::string, std::string> with_small_training(const std::string& algorithm,
                                                              std::map<std::string, std::string> parameters) {
    parameters.merge(those_of(algorithm, {{"emission", "learned"},
                                          {"training-paths", "1500"},
                                          {"cache", "1500"},
                                          {"merge-radius", "0.05"},
                                          {"light-subspaces", "40"},
                                          {"eye-subspaces", "30"}}));
    return parameters;
}

/// The same with every table that a row can have, those of roulette included.
inline std::map<std::string, std::string> with_all_learned(const std::string& algorithm,
                                                           std::map<std::string, std::string> parameters) {
    parameters.merge(those_of(algorithm, {{"roulette", "learned"}}));
    return with_small_training(algorithm, std::move(parameters));
}

/// Whether an algorithm samples every path of a scene. `list` names, space-separated, algorithms that do; what an
/// algorithm finds depends on the ends that it traces from, so that algorithms that trace from the same ends as one in
/// the list count as well.
inline bool complete(const AlgorithmInfo& row, const std::string& list) {
    std::istringstream words(list);
    for (std::string name; words >> name;)
        if ((*find_algorithm(name))->traces == row.traces) return true;
    return false;
}
/// The rows of the catalog that sample every path.
inline std::vector<std::string> algorithms_of(const std::string& list) {
    std::vector<std::string> names;
    for (const AlgorithmInfo* row : catalog())
        if (complete(*row, list)) names.emplace_back(row->name);
    return names;
}

/// A part of a training set, with a guide or without.
inline TrainingData trace_training(const Scene& scene, const RenderSettings& settings, const TrainingWork& work,
                                   const Tables& guide = {}) {
    const auto generator = TrainingGenerator::create(scene, settings, guide);
    if (!generator.ok()) throw std::runtime_error(generator.status().message());
    auto data = generator->trace(work, {});
    if (!data.ok()) throw std::runtime_error(data.status().message());
    return *std::move(data);
}

/// Makes the image of one seed.
using ImageOfSeed = std::function<std::vector<double>(uint64_t seed)>;

/// The image that a renderer makes of one unit.
inline std::vector<double> image_of(const Result<std::unique_ptr<Renderer>>& renderer, const Scene& scene, const RenderUnit& unit) {
    if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
    const Result<Partial> partial = (*renderer)->render(unit, {});
    if (!partial.ok()) throw std::runtime_error(partial.status().message());
    EXPECT_EQ(partial->dropped_count, 0u);
    return develop(*partial, scene.frame().crop);
}

/// A production algorithm from the catalog, with all of its techniques or some. Every seed makes its own tables.
inline ImageOfSeed catalog_image(std::shared_ptr<const Scene> scene, const std::string& algorithm, int max_depth,
                                 uint32_t iterations, std::map<std::string, std::string> parameters = {},
                                 const std::optional<TechniqueMask>& mask = {}) {
    return [=](uint64_t seed) {
        const RenderSettings settings = settings_of(algorithm, with_small_training(algorithm, parameters), seed, max_depth);
        return image_of(create_with_tables(scene, settings, {}, mask ? &*mask : nullptr), *scene,
                        whole_frame(*scene, settings.algorithm, iterations));
    };
}

/// The same with given tables for all seeds.
inline ImageOfSeed table_image(std::shared_ptr<const Scene> scene, const RenderSettings& settings, const Tables& tables,
                               uint32_t iterations, const std::optional<TechniqueMask>& mask = {}) {
    return [=](uint64_t seed) {
        RenderSettings own = settings;
        own.seed = seed;
        return image_of(Renderer::create(scene, own, tables, mask ? &*mask : nullptr), *scene,
                        whole_frame(*scene, own.algorithm, iterations));
    };
}

/// Any algorithm through the production loop, with one light path per sample.
template <class A>
ImageOfSeed algorithm_image(std::shared_ptr<const Scene> scene, const A& algorithm, int max_depth, uint32_t iterations) {
    return [=](uint64_t seed) {
        const Result<Partial> partial = render_unit(algorithm, *scene, seed, max_depth + 1, {},
                                                    whole_frame(*scene, iterations, uint64_t(scene->frame().crop.area())), {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        EXPECT_EQ(partial->dropped_count, 0u);
        return develop(*partial, scene->frame().crop);
    };
}

/// Means per region over the replications: [0] is the frame, the rest is a grid of kGrid x kGrid
/// blocks.
struct RegionMeans {
    static constexpr int kGrid = 4;
    std::vector<std::vector<double>> values = std::vector<std::vector<double>>(1 + kGrid * kGrid);

    void add(const std::vector<double>& image, const Rect& crop) {
        std::vector<double> sum(values.size(), 0), count(values.size(), 0);
        for (int y = 0; y < crop.height(); ++y)
            for (int x = 0; x < crop.width(); ++x) {
                const double v = image[size_t(y) * size_t(crop.width()) + size_t(x)];
                const size_t block = size_t(1 + (y * kGrid / crop.height()) * kGrid + x * kGrid / crop.width());
                for (const size_t r : {size_t(0), block}) sum[r] += v, count[r] += 1;
            }
        for (size_t r = 0; r < values.size(); ++r) values[r].push_back(sum[r] / count[r]);
    }
    Sample frame() const { return Sample(values[0]); }
};

inline RegionMeans replicate(const ImageOfSeed& image, const Rect& crop, int seeds, uint64_t first_seed) {
    RegionMeans means;
    for (int i = 0; i < seeds; ++i) means.add(image(first_seed + uint64_t(i)), crop);
    return means;
}

/// The t statistic needs means that are nearly normally distributed. A mean whose variance comes from rare, bright
/// samples, which perhaps no seed has met, is not. A region gets a test of its own when both estimates have at most
/// this relative standard error: over 32 seeds one replication then scatters by no more than 17 % of the mean. The
/// other regions are tested as one.
inline constexpr double kInformative = 0.03;

/// Adds the tests of "a and b have the same mean" for the frame and its regions. False when the
/// estimates are too noisy for a test of the frame.
inline bool compare(const RegionMeans& a, const RegionMeans& b, const std::string& what, TestFamily* family) {
    const auto add = [&](const std::vector<double>& va, const std::vector<double>& vb, const std::string& where) {
        const Sample sa(va), sb(vb);
        if (std::max(sa.relative_error(), sb.relative_error()) > kInformative) return false;
        family->add(welch_p_value(sa, sb),
                    what + ", " + where + ": " + std::to_string(sa.mean) + " and " + std::to_string(sb.mean));
        return true;
    };
    const bool frame = add(a.values[0], b.values[0], "frame");
    std::vector<double> rest_a(a.values[0].size(), 0), rest_b(b.values[0].size(), 0);
    for (size_t r = 1; r < a.values.size(); ++r) {
        if (add(a.values[r], b.values[r], "block " + std::to_string(r))) continue;
        for (size_t i = 0; i < rest_a.size(); ++i) rest_a[i] += a.values[r][i];
        for (size_t i = 0; i < rest_b.size(); ++i) rest_b[i] += b.values[r][i];
    }
    add(rest_a, rest_b, "remaining blocks");
    return frame;
}

/// The selection with the production number of light paths per iteration.
inline BdptSelection bdpt_selection(const Scene& scene) { return {double(scene.frame().crop.area())}; }

/// Estimates of the path lengths 1 .. max_length, each from an image of its own: images of different depths share
/// samples in some algorithms only, so that their difference would be far noisier than the length's own image in
/// others. One set of tables per seed.
inline std::vector<RegionMeans> lengths_of(const std::shared_ptr<const Scene>& scene, const std::string& name, int max_length,
                                           uint32_t iterations, int seeds, uint64_t first_seed,
                                           const std::map<std::string, std::string>& parameters = {}) {
    std::vector<RegionMeans> lengths(static_cast<size_t>(max_length));
    for (uint64_t seed = first_seed; seed < first_seed + uint64_t(seeds); ++seed) {
        RenderSettings settings = settings_of(name, with_small_training(name, parameters), seed, max_length - 1);
        TrainingReport report;
        const auto tables = make_tables(*scene, settings, {}, &report);
        if (!tables.ok()) throw std::runtime_error(tables.status().message());
        for (int k = 1; k <= max_length; ++k) {
            settings.max_depth = k - 1;
            lengths[size_t(k - 1)].add(table_image(scene, settings, *tables, iterations, TechniqueMask::length(k))(seed),
                                       scene->frame().crop);
        }
    }
    return lengths;
}

}  // namespace lightloom::testing
