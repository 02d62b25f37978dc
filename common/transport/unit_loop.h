#pragma once
// The loop that every algorithm shares: samples of a unit in a fixed order, on all threads, summed so that the bytes do not
// depend on how many there are. Pixels are dealt to threads in fixed chunks; a chunk owns its pixels and adds their samples
// in iteration order; splats are kept in path order and added chunk by chunk at the end.

#include <concepts>
#include <stop_token>
#include <vector>

#include "common/core/fork_join.h"
#include "common/film/partial.h"
#include "common/path/light_walk.h"
#include "common/transport/renderer.h"

namespace lightloom {

struct Splat {
    uint32_t pixel;      ///< Row-major in the crop.
    uint64_t iteration;  ///< For the report, should the value not be finite.
    Rgb value;
};

/// What an algorithm may touch while it makes one sample.
struct SampleContext {
    const Scene& scene;
    uint64_t seed;
    int max_edges;
    RouletteRule roulette;
    uint64_t iteration = 0;           ///< Global number.
    uint32_t pixel = 0;               ///< Row-major in the crop.
    int px = 0, py = 0;               ///< Full-frame coordinates.
    uint64_t group_iteration = 0;     ///< First iteration of the group: keys the light paths together with...
    uint64_t light_path = 0;          ///< ...the number of this sample's light path within the group.
    PathVertex* camera_path;          ///< Room for max_edges + 2.
    PathVertex* light_path_vertices;  ///< Room for max_edges + 1.
    std::vector<Splat>* splats;
    WalkCounters counters;

    void splat(Vec2 film, const Rgb& value) const {
        splats->push_back({uint32_t(scene.frame().crop.index(int(film.x), int(film.y))), iteration, value});
    }
};

/// What an algorithm may know before the first sample of a unit.
struct UnitScope {
    const Scene& scene;
    uint64_t seed;
    int max_edges;
    RouletteRule roulette;
    const UnitWork& work;
    std::stop_token stop;
};

/// What an algorithm brings to all samples of a unit (a light-vertex cache), and what making it has already added to the image.
struct UnitPreparation {
    std::vector<std::vector<Splat>> splats;  ///< By chunk, in path order.
    WalkCounters counters;
    uint64_t light_paths = 0;  ///< Traced in all, splatted or not.
};

/// An algorithm: `sample` returns the camera part of one sample of pixel (px, py) and splats the rest; with
/// kOwnsCameraSamples false it is called once per light path instead and only splats.
template <class A>
concept UnitAlgorithm = requires(const A& a, SampleContext& context) {
    { a.sample(context) } -> std::same_as<Rgb>;
};

/// One that makes something for the whole unit first: `prepare` runs before the first sample, on all threads of the arena,
/// and its result is passed to every sample.
template <class A>
concept PreparedAlgorithm = requires(const A& a, const UnitScope& scope, UnitPreparation& preparation, SampleContext& context) {
    { a.sample(context, a.prepare(scope, &preparation)) } -> std::same_as<Rgb>;
};

/// Sums one unit. See UnitWork for what the numbers mean.
template <class A>
requires UnitAlgorithm<A> || PreparedAlgorithm<A> Result<Partial> render_unit(const A& algorithm, const Scene& scene,
                                                                              const RenderSettings& settings,
                                                                              const RouletteRule& roulette, const UnitWork& work,
                                                                              std::stop_token stop) {
    const Rect& crop = scene.frame().crop;
    const Rect& tile = work.tile;
    if (tile.empty() || tile.x0 < crop.x0 || tile.y0 < crop.y0 || tile.x1 > crop.x1 || tile.y1 > crop.y1)
        return invalid_argument("the unit's tile does not lie inside the frame");
    Partial partial;
    partial.tile = tile;
    partial.samples_per_pixel = work.iteration_count;
    partial.camera.assign(size_t(3 * tile.area()), 0.0);
    partial.light_paths = work.light_path_count;

    UnitPreparation preparation;
    const auto make_sampler = [&] {
        if constexpr (PreparedAlgorithm<A>) {
            const UnitScope scope{scene, settings.seed, settings.max_depth + 1, roulette, work, stop};
            return [&algorithm, state = algorithm.prepare(scope, &preparation)](SampleContext& context) {
                return algorithm.sample(context, state);
            };
        } else {
            return [&algorithm](SampleContext& context) { return algorithm.sample(context); };
        }
    };
    const auto sample = make_sampler();
    if (stop.stop_requested()) return Status(StatusCode::kCancelled, "the unit was cancelled");

    struct Chunk {
        std::vector<Splat> splats;
        std::vector<DroppedSample> dropped;
        uint64_t dropped_count = 0;
        WalkCounters counters;
    };
    const int64_t pixels = tile.area();
    const int64_t chunk_pixels = clamp<int64_t>(pixels / 256, 16, 4096);
    std::vector<Chunk> chunks(size_t((pixels + chunk_pixels - 1) / chunk_pixels));

    fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
        std::vector<PathVertex> camera_path(size_t(settings.max_depth) + 3), light_path(size_t(settings.max_depth) + 2);
        for (size_t c = first_chunk; c != last_chunk; ++c) {
            if (stop.stop_requested()) return;
            Chunk& chunk = chunks[c];
            SampleContext context{.scene = scene,
                                  .seed = settings.seed,
                                  .max_edges = settings.max_depth + 1,
                                  .roulette = roulette,
                                  .camera_path = camera_path.data(),
                                  .light_path_vertices = light_path.data(),
                                  .splats = &chunk.splats,
                                  .counters = {}};
            context.group_iteration = work.group_first_iteration;
            const int64_t end = std::min(pixels, int64_t(c + 1) * chunk_pixels);
            for (int64_t i = int64_t(c) * chunk_pixels; i < end; ++i) {
                context.px = tile.x0 + int(i % tile.width());
                context.py = tile.y0 + int(i / tile.width());
                context.pixel = uint32_t(crop.index(context.px, context.py));
                double* sum = &partial.camera[size_t(3 * i)];
                for (uint32_t b = 0; b < work.iteration_count; ++b) {
                    context.iteration = work.first_iteration + b;
                    context.light_path = work.first_light_path + uint64_t(b) * uint64_t(pixels) + uint64_t(i);
                    const Rgb value = sample(context);
                    if (!is_finite(value)) {
                        if (chunk.dropped.size() < Partial::kMaxDroppedRecords)
                            chunk.dropped.push_back({context.iteration, context.pixel, false});
                        ++chunk.dropped_count;
                        continue;
                    }
                    sum[0] += value.r, sum[1] += value.g, sum[2] += value.b;
                }
            }
            chunk.counters = context.counters;
        }
    });
    if (stop.stop_requested()) return Status(StatusCode::kCancelled, "the unit was cancelled");

    partial.counters.camera_samples = uint64_t(pixels) * work.iteration_count;
    partial.counters.light_paths = std::max(work.light_path_count, preparation.light_paths);
    std::vector<double> splat_sums;
    const auto drop = [&](const DroppedSample& d) {
        if (partial.dropped.size() < Partial::kMaxDroppedRecords) partial.dropped.push_back(d);
    };
    const auto add_counters = [&](const WalkCounters& c) {
        partial.counters.rays += c.rays;
        partial.counters.vertices += c.vertices;
        partial.counters.connections += c.connections;
    };
    const auto add_splats = [&](const std::vector<Splat>& splats) {
        if (!splats.empty() && splat_sums.empty()) splat_sums.assign(size_t(3 * crop.area()), 0.0);
        for (const Splat& s : splats) {
            if (!is_finite(s.value)) {
                ++partial.dropped_count;
                drop({s.iteration, s.pixel, true});
                continue;
            }
            double* sum = &splat_sums[size_t(s.pixel) * 3];
            sum[0] += s.value.r, sum[1] += s.value.g, sum[2] += s.value.b;
        }
    };
    for (const std::vector<Splat>& splats : preparation.splats) add_splats(splats);
    add_counters(preparation.counters);
    for (const Chunk& chunk : chunks) {
        partial.dropped_count += chunk.dropped_count;
        for (const DroppedSample& d : chunk.dropped) drop(d);
        add_counters(chunk.counters);
        add_splats(chunk.splats);
    }
    for (uint32_t p = 0; p * size_t(3) < splat_sums.size(); ++p) {
        const double* sum = &splat_sums[size_t(p) * 3];
        if (sum[0] != 0 || sum[1] != 0 || sum[2] != 0) partial.splats.push_back({p, {sum[0], sum[1], sum[2]}});
    }
    return partial;
}

}  // namespace lightloom
