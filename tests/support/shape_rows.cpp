// Rows of the catalog with shapes that no algorithm of the product has yet: one does its own loops, one puts all of its
// light into splats, and one makes its state anew for every iteration. Their means are those of `bdpt`.

#include "common/transport/bdpt.h"
#include "common/transport/lvcbpt.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {
namespace {

/// bdpt with loops of its own, which deal rows of pixels to lanes.
template <class Selection>
struct OwnedStub {
    Selection selection;

    void run(const UnitScope& scope, UnitSink& sink) const {
        constexpr int kRows = 3;
        const RenderUnit& work = scope.work;
        const Rect &tile = work.tile, &crop = scope.scene.frame().crop;
        const size_t lanes = size_t((tile.height() + kRows - 1) / kRows);
        sink.open(lanes);
        fork_join(lanes, [&](size_t first, size_t last) {
            std::vector<PathVertex> camera_path(size_t(scope.max_edges) + 2), light_path(size_t(scope.max_edges) + 1);
            for (size_t lane = first; lane != last && !scope.stop.stop_requested(); ++lane) {
                SampleContext context{.scene = scope.scene,
                                      .seed = scope.seed,
                                      .max_edges = scope.max_edges,
                                      .roulette = scope.roulette,
                                      .group_iteration = work.group_first_iteration,
                                      .camera_path = camera_path.data(),
                                      .light_path_vertices = light_path.data(),
                                      .counters = {}};
                const int64_t begin = int64_t(lane) * kRows * tile.width();
                const int64_t end = std::min(tile.area(), begin + kRows * tile.width());
                for (int64_t i = begin; i < end; ++i) {
                    context.px = tile.x0 + int(i % tile.width());
                    context.py = tile.y0 + int(i / tile.width());
                    context.pixel = uint32_t(crop.index(context.px, context.py));
                    for (uint32_t b = 0; b < work.iteration_count; ++b) {
                        context.iteration = work.first_iteration + b;
                        context.light_path = work.first_light_path + uint64_t(b) * uint64_t(tile.area()) + uint64_t(i);
                        trace_bdpt_sample<ViewDetail::kFull>(
                            context, context.roulette, {}, [](const PathVertex*, int) {},
                            [&](const PathContribution& c, PathView& view) {
                                const Rgb value = c.value * float(mis_weight(view, c.technique, selection.on(view)));
                                if (c.technique.splats())
                                    sink.splat(lane, uint32_t(crop.index(int(c.film.x), int(c.film.y))), context.iteration, value);
                                else
                                    sink.camera(lane, uint32_t(i), context.iteration, value);
                            });
                    }
                }
                sink.counters(lane) = context.counters;
            }
        });
    }
};

/// bdpt with a random pixel for every light path; what the camera finds there is a splat as well.
template <class Selection>
struct SplatStub {
    Selection selection;

    void run(const UnitScope& scope, UnitSink& sink) const {
        constexpr uint64_t kPaths = 256;
        const RenderUnit& work = scope.work;
        const Rect& crop = scope.scene.frame().crop;
        const size_t lanes = size_t((work.light_path_count + kPaths - 1) / kPaths);
        sink.open(lanes);
        fork_join(lanes, [&](size_t first, size_t last) {
            std::vector<PathVertex> camera_path(size_t(scope.max_edges) + 2), light_path(size_t(scope.max_edges) + 1);
            for (size_t lane = first; lane != last && !scope.stop.stop_requested(); ++lane) {
                SampleContext context{.scene = scope.scene,
                                      .seed = scope.seed,
                                      .max_edges = scope.max_edges,
                                      .roulette = scope.roulette,
                                      .group_iteration = work.group_first_iteration,
                                      .camera_path = camera_path.data(),
                                      .light_path_vertices = light_path.data(),
                                      .counters = {}};
                for (uint64_t m = lane * kPaths; m < std::min(work.light_path_count, (lane + 1) * kPaths); ++m) {
                    context.light_path = context.iteration = work.first_light_path + m;
                    Rng rng({scope.seed, Stage::kPairing, work.group_first_iteration, context.light_path});
                    context.px = crop.x0 + int(rng.below(uint32_t(crop.width())));
                    context.py = crop.y0 + int(rng.below(uint32_t(crop.height())));
                    context.pixel = uint32_t(crop.index(context.px, context.py));
                    trace_bdpt_sample<ViewDetail::kFull>(
                        context, context.roulette, {}, [](const PathVertex*, int) {},
                        [&](const PathContribution& c, PathView& view) {
                            const float weight = float(mis_weight(view, c.technique, selection.on(view)));
                            const bool light = c.technique.splats();
                            const uint32_t pixel = light ? uint32_t(crop.index(int(c.film.x), int(c.film.y))) : context.pixel;
                            sink.splat(lane, pixel, work.first_iteration, c.value * (light ? weight : weight * float(crop.area())));
                        });
                }
                sink.counters(lane) = context.counters;
            }
        });
    }
};

/// Uniform connections to a cache that lives for one iteration.
template <class Selection>
struct AnewStub : CachedAlgorithm<UniformConnections<Selection>> {
    static constexpr bool kPerIteration = true;
};

constexpr ParameterInfo kParameters[] = {kRouletteStart, kRouletteMin};

template <template <class> class Stub>
Result<std::unique_ptr<Renderer>> make_pairing(const RendererRequest& r) {
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(BdptSelection{double(r.light_paths_per_iteration())});
        return Stub<std::remove_cvref_t<decltype(selection)>>{selection};
    });
}

Result<std::unique_ptr<Renderer>> make_anew(const RendererRequest& r) {
    constexpr int kConnections = 2;
    constexpr double kVerticesPerPath = 2.5;  // approximate
    return make_unit_renderer(r, [&](auto&& select) {
        const auto selection = select(UniformSelection{double(r.light_paths_per_iteration()), kConnections / kVerticesPerPath,
                                                       TypicalSurvival(roulette_of(r.settings.algorithm))});
        return AnewStub<std::remove_cvref_t<decltype(selection)>>{{{selection, kConnections}}};
    });
}

constexpr std::string_view kSource = "own", kBias = "unbiased; misses what bdpt misses";

const AlgorithmInfo kRows[] = {
    {.name = "stub-owned",
     .summary = "bdpt by its own loops",
     .source = kSource,
     .bias = kBias,
     .parameters = kParameters,
     .light_paths_per_pixel = one_light_path,
     .shares_light_paths = true,
     .make = make_pairing<OwnedStub>},
    {.name = "stub-splats",
     .summary = "bdpt of which all light is in splats",
     .source = kSource,
     .bias = kBias,
     .parameters = kParameters,
     .frame = FrameShape::kWhole,
     .camera_samples = false,
     .light_paths_per_pixel = one_light_path,
     .shares_light_paths = true,
     .make = make_pairing<SplatStub>},
    {.name = "stub-anew",
     .summary = "a cache for every iteration",
     .source = kSource,
     .bias = kBias,
     .parameters = kParameters,
     .frame = FrameShape::kWhole,
     .light_paths_per_pixel = one_light_path,
     .shares_light_paths = true,
     .make = make_anew},
};

[[maybe_unused]] const bool kAdded = [] {
    for (const AlgorithmInfo& row : kRows) add_to_catalog(row);
    return true;
}();

}  // namespace
}  // namespace lightloom
