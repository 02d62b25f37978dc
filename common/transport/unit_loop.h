#pragma once
// The loop that every algorithm shares: samples of a unit in a fixed order, on all threads, summed so that the bytes do not
// depend on how many there are. Pixels are dealt to threads in fixed chunks; a chunk owns its pixels and adds their samples
// in iteration order; splats are kept in path order and added chunk by chunk at the end of each batch (RenderUnit::batch()).
// What is said of units below holds for each batch of a unit.
//
// An algorithm has one of three shapes:
//   per sample   trace(context, contribute)                           calls contribute(PathContribution, PathView&) for everything
//                weight(view, technique)                              that one camera sample and its light sub-path give
//   prepared     State prepare(scope, preparation, contribute)        makes something for the whole unit first (a cache, photons)
//                trace(context, state, contribute)                    and passes it to every sample; with kPerIteration it is
//                weight(state, view, technique)                       made anew for each iteration of the unit. What light paths
//                                                                     splat meanwhile goes to contribute(PathContribution,
//                                                                     PathView&, weight, number of the path, chunk)
//   owned        run(scope, sink)                                     does its own loops (pairing of whole units, Markov chains)

#include <concepts>
#include <stop_token>
#include <vector>

#include "common/core/fork_join.h"
#include "common/film/partial.h"
#include "common/path/light_walk.h"
#include "common/transport/contribution.h"
#include "common/transport/unit.h"

namespace lightloom {

struct Splat {
    uint32_t pixel;      ///< Row-major in the crop.
    uint64_t iteration;  ///< Reported if the value is not finite.
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
    WalkCounters counters;
};

/// What an algorithm may know before the first sample of a unit.
struct UnitScope {
    const Scene& scene;
    uint64_t seed;
    int max_edges;
    RouletteRule roulette;
    const RenderUnit& work;
    std::stop_token stop;
};

/// What has been added to the image while a unit's state was made.
struct UnitPreparation {
    std::vector<std::vector<Splat>> splats;  ///< By chunk, in path order.
    WalkCounters counters;
    uint64_t light_paths = 0;  ///< Traced in all, splatted or not.
};

/// Takes the light of an algorithm that does its own loops. Each thread writes to lanes of its own; the lanes are
/// joined in the order of their numbers, so that the sums depend on how the algorithm deals its work to lanes and not
/// on threads.
class UnitSink {
  public:
    struct Lane {
        std::vector<Splat> camera, splats;
        WalkCounters counters;
    };

    explicit UnitSink(const RenderUnit& work) : work_(work) {}
    /// Must be called once, before the first lane is written to.
    void open(size_t lanes) { lanes_.resize(lanes); }
    /// Adds a camera sample, or a part of one, of a pixel of the unit's tile. `pixel` is row-major in the tile.
    void camera(size_t lane, uint32_t pixel, uint64_t iteration, const Rgb& value) {
        lanes_[lane].camera.push_back({pixel, iteration, value});
    }
    /// Adds a light path's contribution to a pixel of the crop.
    void splat(size_t lane, uint32_t pixel, uint64_t iteration, const Rgb& value) {
        lanes_[lane].splats.push_back({pixel, iteration, value});
    }
    WalkCounters& counters(size_t lane) { return lanes_[lane].counters; }
    const RenderUnit& work() const { return work_; }
    const std::vector<Lane>& lanes() const { return lanes_; }

  private:
    const RenderUnit& work_;
    std::vector<Lane> lanes_;
};

/// Stands for any callable that takes contributions, where a concept asks whether an algorithm accepts one.
struct AnyContribute {
    void operator()(const PathContribution&, PathView&) const {}
    template <class Chunk>
    void operator()(const PathContribution&, PathView&, float, uint64_t, Chunk&) const {}
};

template <class A>
concept UnitAlgorithm = requires(const A& a, SampleContext& context, const PathView& view) {
    a.trace(context, AnyContribute{});
    { a.weight(view, Technique{}) } -> std::same_as<float>;
};

template <class A>
concept PreparedAlgorithm = requires(const A& a, const UnitScope& scope, UnitPreparation& preparation, SampleContext& context) {
    a.trace(context, a.prepare(scope, &preparation, AnyContribute{}), AnyContribute{});
};

template <class A>
concept OwnedAlgorithm = requires(const A& a, const UnitScope& scope, UnitSink& sink) {
    a.run(scope, sink);
};

/// Whether a prepared algorithm makes its state anew for every iteration.
template <class A>
consteval bool prepares_per_iteration() {
    if constexpr (requires { A::kPerIteration; }) return A::kPerIteration;
    return false;
}
/// Whether the weights depend on what the unit itself has traced. The weights of a group sum to one only together, and a splat
/// lands in other units' pixels, so that such an algorithm needs units of the whole frame.
template <class A>
consteval bool has_unit_selection() {
    if constexpr (requires { A::kUnitSelection; }) return A::kUnitSelection;
    return false;
}

namespace detail {

struct UnitChunk {
    std::vector<Splat> splats;
    std::vector<DroppedSample> dropped;
    uint64_t dropped_count = 0;
    WalkCounters counters;
};

/// The sums of one unit.
class UnitSums {
  public:
    UnitSums(const Scene& scene, const RenderUnit& work) : crop_(scene.frame().crop) {
        partial.tile = work.tile;
        partial.samples_per_pixel = work.samples_per_pixel();
        partial.camera.assign(size_t(3 * work.tile.area()), 0.0);
        partial.light_paths = work.light_path_count;
        partial.counters.camera_samples = uint64_t(work.tile.area()) * work.samples_per_pixel();
    }

    /// `pixel` is row-major in the tile.
    void add_camera(size_t pixel, const Rgb& value) {
        double* sum = &partial.camera[3 * pixel];
        sum[0] += value.r, sum[1] += value.g, sum[2] += value.b;
    }
    void add(const WalkCounters& c) {
        partial.counters.rays += c.rays;
        partial.counters.vertices += c.vertices;
        partial.counters.connections += c.connections;
    }
    void add(const std::vector<Splat>& splats) {
        if (!splats.empty() && splat_sums_.empty()) splat_sums_.assign(size_t(3 * crop_.area()), 0.0);
        for (const Splat& s : splats) {
            if (!is_finite(s.value)) {
                ++partial.dropped_count;
                drop({s.iteration, s.pixel, true});
                continue;
            }
            double* sum = &splat_sums_[size_t(s.pixel) * 3];
            sum[0] += s.value.r, sum[1] += s.value.g, sum[2] += s.value.b;
        }
    }
    void add(const UnitPreparation& preparation) {
        for (const std::vector<Splat>& splats : preparation.splats) add(splats);
        add(preparation.counters);
        traced_light_paths_ += preparation.light_paths;
    }
    /// `count` empty chunks. Their memory is that of the chunks before, and it stays until the unit is done: freed before the
    /// partial's splats are allocated it would go back to the system, which costs bdpt two per cent in page faults.
    std::vector<UnitChunk>& open_chunks(size_t count) {
        chunks_.resize(count);
        for (UnitChunk& chunk : chunks_) {
            chunk.splats.clear();
            chunk.dropped.clear();
            chunk.dropped_count = 0;
            chunk.counters = {};
        }
        return chunks_;
    }
    void add_chunks() {
        for (const UnitChunk& chunk : chunks_) {
            partial.dropped_count += chunk.dropped_count;
            for (const DroppedSample& d : chunk.dropped) drop(d);
            add(chunk.counters);
            add(chunk.splats);
        }
    }
    void add(const UnitSink& sink) {
        for (const UnitSink::Lane& lane : sink.lanes()) {
            for (const Splat& s : lane.camera) {
                if (is_finite(s.value)) {
                    add_camera(s.pixel, s.value);
                } else {
                    const Rect& tile = partial.tile;
                    const int x = tile.x0 + int(s.pixel % uint32_t(tile.width())),
                              y = tile.y0 + int(s.pixel / uint32_t(tile.width()));
                    ++partial.dropped_count;
                    drop({s.iteration, uint32_t(crop_.index(x, y)), false});
                }
            }
            add(lane.splats);
            add(lane.counters);
        }
    }
    Partial finish() && {
        partial.counters.light_paths = std::max(partial.light_paths, traced_light_paths_);
        const size_t pixels = splat_sums_.size() / 3;
        const auto splatted = [&](size_t p) {
            return splat_sums_[3 * p] != 0 || splat_sums_[3 * p + 1] != 0 || splat_sums_[3 * p + 2] != 0;
        };
        size_t count = 0;
        for (size_t p = 0; p < pixels; ++p) count += splatted(p);
        partial.splats.reserve(count);
        for (size_t p = 0; p < pixels; ++p) {
            const double* sum = &splat_sums_[3 * p];
            if (splatted(p)) partial.splats.push_back({uint32_t(p), {sum[0], sum[1], sum[2]}});
        }
        return std::move(partial);
    }

    Partial partial;

  private:
    void drop(const DroppedSample& d) {
        if (partial.dropped.size() < Partial::kMaxDroppedRecords) partial.dropped.push_back(d);
    }

    const Rect crop_;
    std::vector<UnitChunk> chunks_;
    std::vector<double> splat_sums_;
    uint64_t traced_light_paths_ = 0;
};

/// Makes the samples of `scope.work` and adds them. `trace(context, contribute)` and `weight(view, technique)` are the algorithm's,
/// with its state bound where it has one.
template <class Trace, class Weight>
void add_samples(const UnitScope& scope, const Trace& trace, const Weight& weight, UnitSums* sums) {
    const RenderUnit& work = scope.work;
    const Rect &crop = scope.scene.frame().crop, &tile = work.tile;
    const int64_t pixels = tile.area();
    const int64_t chunk_pixels = clamp<int64_t>(pixels / 256, 16, 4096);
    std::vector<UnitChunk>& chunks = sums->open_chunks(size_t((pixels + chunk_pixels - 1) / chunk_pixels));
    fork_join(chunks.size(), [&](size_t first_chunk, size_t last_chunk) {
        std::vector<PathVertex> camera_path(size_t(scope.max_edges) + 2), light_path(size_t(scope.max_edges) + 1);
        for (size_t c = first_chunk; c != last_chunk; ++c) {
            if (scope.stop.stop_requested()) return;
            UnitChunk& chunk = chunks[c];
            SampleContext context{.scene = scope.scene,
                                  .seed = scope.seed,
                                  .max_edges = scope.max_edges,
                                  .roulette = scope.roulette,
                                  .group_iteration = work.group_first_iteration,
                                  .camera_path = camera_path.data(),
                                  .light_path_vertices = light_path.data(),
                                  .counters = {}};
            const int64_t end = std::min(pixels, int64_t(c + 1) * chunk_pixels);
            for (int64_t i = int64_t(c) * chunk_pixels; i < end; ++i) {
                context.px = tile.x0 + int(i % tile.width());
                context.py = tile.y0 + int(i / tile.width());
                context.pixel = uint32_t(crop.index(context.px, context.py));
                for (uint32_t b = 0; b < work.iteration_count; ++b) {
                    context.iteration = work.first_iteration + b;
                    context.light_path = work.first_light_path + uint64_t(b) * uint64_t(pixels) + uint64_t(i);
                    Rgb value;
                    trace(context, [&](const PathContribution& found, PathView& view) {
                        const Rgb weighted = found.value * weight(view, found.technique);
                        if (found.technique.splats())
                            chunk.splats.push_back(
                                {uint32_t(crop.index(int(found.film.x), int(found.film.y))), context.iteration, weighted});
                        else
                            value += weighted;
                    });
                    if (!is_finite(value)) {
                        if (chunk.dropped.size() < Partial::kMaxDroppedRecords)
                            chunk.dropped.push_back({context.iteration, context.pixel, false});
                        ++chunk.dropped_count;
                        continue;
                    }
                    sums->add_camera(size_t(i), value);
                }
            }
            chunk.counters = context.counters;
        }
    });
    sums->add_chunks();
}

/// Adds one preparation and the samples that share its state.
template <PreparedAlgorithm A>
void add_prepared(const A& algorithm, const UnitScope& scope, UnitSums* sums) {
    UnitPreparation preparation;
    const Rect& crop = scope.scene.frame().crop;
    const auto state =
        algorithm.prepare(scope, &preparation, [&](const PathContribution& c, PathView&, float weight, uint64_t, auto& chunk) {
            const uint32_t pixel = uint32_t(crop.index(int(c.film.x), int(c.film.y)));
            chunk.splats.push_back({pixel, scope.work.first_iteration, c.value * weight});
        });
    if (scope.stop.stop_requested()) return;
    sums->add(preparation);
    add_samples(
        scope, [&](SampleContext& context, auto&& contribute) { algorithm.trace(context, state, contribute); },
        [&](const PathView& view, Technique own) { return algorithm.weight(state, view, own); }, sums);
}

/// Adds one batch, whose light paths are the same number in every iteration if states are made for each.
template <class A>
void add_batch(const A& algorithm, const UnitScope& scope, UnitSums* sums) {
    const RenderUnit& work = scope.work;
    if constexpr (OwnedAlgorithm<A>) {
        UnitSink sink(work);
        algorithm.run(scope, sink);
        sums->add(sink);
    } else if constexpr (PreparedAlgorithm<A> && prepares_per_iteration<A>()) {
        // Light paths of an iteration follow those of the one before. The iteration is part of the keys of its
        // uncounted paths, which would otherwise be the same in every iteration.
        const uint64_t light_paths = work.iteration_count > 0 ? work.light_path_count / work.iteration_count : 0;
        for (uint32_t b = 0; b < work.iteration_count && !scope.stop.stop_requested(); ++b) {
            RenderUnit iteration = work;
            iteration.first_iteration = iteration.group_first_iteration = work.first_iteration + b;
            iteration.iteration_count = 1;
            iteration.first_light_path = work.first_light_path + b * light_paths;
            iteration.light_path_count = light_paths;
            add_prepared(algorithm, UnitScope{scope.scene, scope.seed, scope.max_edges, scope.roulette, iteration, scope.stop},
                         sums);
        }
    } else if constexpr (PreparedAlgorithm<A>) {
        add_prepared(algorithm, scope, sums);
    } else {
        add_samples(
            scope, [&](SampleContext& context, auto&& contribute) { algorithm.trace(context, contribute); },
            [&](const PathView& view, Technique own) { return algorithm.weight(view, own); }, sums);
    }
}

}  // namespace detail

/// Sums one unit of the image of `seed`. kInvalidArgument for a unit that does not lie inside the frame, kCancelled after a stop
/// request.
template <class A>
requires UnitAlgorithm<A> || PreparedAlgorithm<A> || OwnedAlgorithm<A> Result<Partial> render_unit(
    const A& algorithm, const Scene& scene, uint64_t seed, int max_edges, const RouletteRule& roulette, const RenderUnit& work,
    std::stop_token stop) {
    const Rect &crop = scene.frame().crop, &tile = work.tile;
    if (tile.empty() || tile.x0 < crop.x0 || tile.y0 < crop.y0 || tile.x1 > crop.x1 || tile.y1 > crop.y1)
        return invalid_argument("the unit's tile does not lie inside the frame");
    if constexpr (PreparedAlgorithm<A> && prepares_per_iteration<A>()) {
        if (work.iteration_count > 0 && work.light_path_count % work.iteration_count != 0)
            return invalid_argument("the unit's light paths are not the same number in every iteration");
    }
    detail::UnitSums sums(scene, work);
    uint32_t done = 0;
    do {
        const RenderUnit batch = work.batch(done);
        detail::add_batch(algorithm, UnitScope{scene, seed, max_edges, roulette, batch, stop}, &sums);
        done += batch.iteration_count;
    } while (done < work.iteration_count && !stop.stop_requested());
    if (stop.stop_requested()) return Status(StatusCode::kCancelled, "the unit was cancelled");
    return std::move(sums).finish();
}

}  // namespace lightloom
