#pragma once
// Independent replications of renders, reduced to the means of a few regions, and their comparison.

#include <algorithm>
#include <functional>
#include <map>
#include <sstream>

#include "common/transport/bdpt.h"
#include "common/transport/light.h"
#include "common/transport/path.h"
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
    for (int64_t i = 0; i < partial.tile.area(); ++i) {
        const int x = partial.tile.x0 + int(i % partial.tile.width()), y = partial.tile.y0 + int(i / partial.tile.width());
        image[size_t(crop.index(x, y))] += scalar(&partial.camera[size_t(3 * i)]) / partial.samples_per_pixel;
    }
    for (const SplatSum& s : partial.splats) image[s.pixel] += scalar(s.rgb.data()) / double(partial.light_paths);
    return image;
}

/// The whole frame as one unit.
inline UnitWork whole_frame(const Scene& scene, uint32_t samples_per_pixel) {
    const Rect& crop = scene.frame().crop;
    return {0, samples_per_pixel, 0, crop, 0, uint64_t(samples_per_pixel) * uint64_t(crop.area())};
}

/// Training and caches that suit 32 x 32 pixels, for the rows of the catalog that have them; what is set already stays.
inline std::map<std::string, std::string> with_small_training(const std::string& algorithm,
                                                              std::map<std::string, std::string> parameters) {
    const Result<const AlgorithmInfo*> row = find_algorithm(algorithm);
    if (!row.ok()) return parameters;
    for (const auto& [name, value] : {std::pair<const char*, const char*>{"training-paths", "1500"},
                                      {"cache", "1500"},
                                      {"light-subspaces", "40"},
                                      {"eye-subspaces", "30"}})
        if (has_parameter(**row, name)) parameters.insert({name, value});
    return parameters;
}

/// A list of algorithms as the tables of test scenes hold it, space-separated. Methods with tables sample what `bdpt` samples:
/// where that is in the list, every one of the catalog is.
inline std::vector<std::string> algorithms_of(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream words(list);
    for (std::string name; words >> name;) names.push_back(name);
    if (std::find(names.begin(), names.end(), "bdpt") != names.end())
        for (const AlgorithmInfo& row : catalog())
            if (row.needs_tables) names.emplace_back(row.name);
    return names;
}

/// Makes the image of one seed.
using ImageOfSeed = std::function<std::vector<double>(uint64_t seed)>;

/// A production algorithm from the catalog. Every seed makes its own tables.
inline ImageOfSeed catalog_image(std::shared_ptr<const Scene> scene, const std::string& algorithm, int max_depth,
                                 uint32_t samples_per_pixel, std::map<std::string, std::string> parameters = {}) {
    return [=](uint64_t seed) {
        RenderSettings settings{algorithm, with_small_training(algorithm, parameters), seed, max_depth};
        Result<std::unique_ptr<Renderer>> renderer = create_with_tables(scene, settings, {});
        if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
        Result<Partial> partial = (*renderer)->render(whole_frame(*scene, samples_per_pixel), {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        EXPECT_EQ(partial->dropped_count, 0u);
        return develop(*partial, scene->frame().crop);
    };
}

/// Any algorithm through the production loop.
template <UnitAlgorithm A>
ImageOfSeed algorithm_image(std::shared_ptr<const Scene> scene, const A& algorithm, int max_depth, uint32_t samples_per_pixel) {
    return [=](uint64_t seed) {
        RenderSettings settings;
        settings.seed = seed;
        settings.max_depth = max_depth;
        Result<Partial> partial = render_unit(algorithm, *scene, settings, {}, whole_frame(*scene, samples_per_pixel), {});
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

/// The t statistic needs means that are nearly normal, and a mean whose variance sits in rare,
/// bright samples that no seed may have met is not. A region enters with its own test when both
/// estimates know it to this relative standard error: over 32 seeds one replication then scatters
/// by no more than 17 % of the mean. The regions that do not enter are tested as one.
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

/// Light paths per iteration as production sets it.
inline BdptSelection bdpt_selection(const Scene& scene) { return {double(scene.frame().crop.area())}; }

/// bdpt with some of its techniques switched off; the weights of the others sum to one again.
struct MaskedSelection {
    static constexpr bool kMerges = false;
    BdptSelection all;
    bool hits = true, next_event = true, connections = true,
         light_tracing = true;           ///< s = 0, s = 1, 2 <= s < k, s = k
    int min_k = 1, max_k = kMaxEdges;    ///< Lengths that exist.
    int max_light_vertices = kMaxEdges;  ///< Light sub-paths are cut here: techniques beyond do not exist.
    int only_s = -1;                     ///< Only this technique; -1: all that are on.

    int s_min(int k) const { return all.s_min(k); }
    int s_max(int k) const { return std::min(all.s_max(k), max_light_vertices); }
    bool enabled(int k, int s) const {
        if (k < min_k || k > max_k || s > s_max(k) || (only_s >= 0 && s != only_s)) return false;
        return s == 0 ? hits : s == 1 ? next_event : s == k ? light_tracing : connections;
    }
    double connect_factor(const PathView& view, int s) const { return enabled(view.k, s) ? all.connect_factor(view, s) : 0; }
};

}  // namespace lightloom::testing
