#include "tests/support/stub_rows.h"

#include <cmath>

#include "common/transport/bdpt.h"
#include "common/transport/light_cache.h"
#include "common/transport/unit_renderer.h"
#include "tests/support/path_rebuild.h"

namespace lightloom::testing {
namespace {

// ---- Merging: prepared, per iteration, with weights that depend on the unit.

constexpr ParameterInfo kPhotons{"photons", 3e-4, 1e-6, 1, false, "photons' light sub-paths per pixel and iteration"};
constexpr ParameterInfo kRadius{"radius", 0.1, 1e-3, 1, false, "radius of the first iteration, in scene units"};

struct MergingSelection {
    double light_paths_per_iteration = 1, radius = 0.1;

    struct OnPath : PlainTechniques {
        static constexpr bool kMerges = true;
        double light_paths_per_iteration, radius;

        double lens() const { return light_paths_per_iteration; }
        double merge(int) const { return light_paths_per_iteration * kPiD * radius * radius; }
    };
    OnPath on(const PathView& view) const { return {{view}, light_paths_per_iteration, radius}; }
};

template <class Select>
struct StubMerging {
    Select select;
    MergingSelection first;  ///< For the first iteration.

    static constexpr bool kPerIteration = true, kUnitSelection = true;

    using Selection = decltype(std::declval<const Select&>()(MergingSelection{}));
    struct State {
        Selection selection;
        LightCache photons;
        double radius;
    };

    float weight(const State& state, const PathView& view, Technique own) const {
        return float(mis_weight(view, own, state.selection.on(view)));
    }

    template <class Contribute>
    State prepare(const UnitScope& scope, UnitPreparation* preparation, Contribute&& contribute) const {
        MergingSelection now = first;
        now.radius *= std::pow(1.0 + double(scope.work.group_first_iteration), -1.0 / 6);
        State state{select(now), {}, now.radius};
        const auto splat = [&](const PathVertex* y, int s, Vec2 lens_sample, uint64_t m, auto& chunk) {
            PathView view;
            PathVertex z0;
            Vec2 film;
            z0.p = scope.scene.camera().sample_lens(lens_sample);
            const Rgb c = connect_to_camera(scope.scene, y, s, &z0.p, &film, &view, &chunk.counters);
            if (c.is_black()) return;
            const PathContribution found = from_light_path(c, Technique::lens(s), y, &z0, 1, film);
            contribute(found, view, weight(state, view, found.technique), m, chunk);
        };
        state.photons = trace_light_cache(
            scope, scope.work.light_path_count, preparation, [](PathVertex*, int) {}, splat);
        return state;
    }

    template <class Contribute>
    void trace(SampleContext& context, const State& state, Contribute&& contribute) const {
        const Scene& scene = context.scene;
        PathVertex* z = context.camera_path;
        PathView view;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) {
            contribute_hit<ViewDetail::kFull>(scene, z, t, &view, contribute);
            if (t > context.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<ViewDetail::kFull>(scene, z, t, sampler, 1, &view, &context.counters, contribute);
            merges(context, state, t, contribute);
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= context.max_edges) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, contribute);
        };
        trace_camera_path(scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters, visit,
                          escape);
    }

    template <class Contribute>
    void merges(SampleContext& context, const State& state, int t, Contribute&& contribute) const {
        const PathVertex* z = context.camera_path;
        const PathVertex& v = z[t - 1];
        PathView view;
        const float radius2 = float(state.radius * state.radius);
        const float scale = float(1 / (first.light_paths_per_iteration * kPiD * state.radius * state.radius));
        for (const LightCache::Path& path : state.photons.paths) {
            const LightVertex* y = path.length > 0 ? state.photons.at(path.first_vertex) : nullptr;
            for (int s = 2; s <= int(path.length) && s + t - 2 <= context.max_edges; ++s) {
                const LightVertex& photon = y[s - 1];
                if (length_squared(photon.p - v.p) > radius2 || dot(photon.ng, v.ng) < 0.7f) continue;
                const Rgb c = merge(context.scene, y, s, z, t, &view);
                if (c.is_black()) continue;
                contribute(PathContribution{.value = c * scale, .technique = Technique::merge(s - 1), .t = t, .y = y, .z = z},
                           view);
            }
        }
    }
};

constexpr ParameterInfo kMergingParameters[] = {kRouletteStart, kRouletteMin, kPhotons, kRadius};

const AlgorithmInfo kMergingRow{
    .name = kStubMerging,
    .summary = "merging with photons of the iteration, for tests",
    .source = "Georgiev et al. 2012",
    .bias = "its kernel blurs",
    .merges = true,
    .parameters = kMergingParameters,
    .frame = FrameShape::kWhole,
    .light_paths_per_pixel = [](const AlgorithmSettings& s) { return s.value(kPhotons.name); },
    .shares_light_paths = true,
    .make = [](const RendererRequest& r) -> Result<std::unique_ptr<Renderer>> {
        const MergingSelection first{double(r.light_paths_per_iteration()), r.settings.algorithm.value(kRadius.name)};
        return make_unit_renderer(r, [&](auto&& select) {
            return StubMerging<std::remove_cvref_t<decltype(select)>>{select, first};
        });
    },
};

// ---- Pairing: has loops of its own.

template <class Selection>
struct StubPairing {
    Selection selection;

    void run(const UnitScope& scope, UnitSink& sink) const {
        constexpr uint64_t kLane = 2048;  ///< Light paths or camera samples per lane, whatever the number of threads.
        const RenderUnit& work = scope.work;
        const uint64_t samples = uint64_t(work.tile.area()) * work.iteration_count, paths = work.light_path_count;
        const uint64_t light_lanes = (paths + kLane - 1) / kLane, camera_lanes = (samples + kLane - 1) / kLane;
        sink.open(size_t(light_lanes + camera_lanes));
        std::vector<std::vector<PathVertex>> light(paths);
        fork_join(size_t(light_lanes), [&](size_t first, size_t last) {
            for (size_t lane = first; lane < last && !scope.stop.stop_requested(); ++lane)
                for (uint64_t m = lane * kLane; m < std::min(paths, (lane + 1) * kLane); ++m)
                    light[m] = trace_light(scope, m, lane, sink);
        });
        if (scope.stop.stop_requested()) return;
        Rng rng({scope.seed, Stage::kPairing, work.group_first_iteration, work.first_light_path});
        const uint64_t rotation = paths > 0 ? rng.next_u64() % paths : 0;
        fork_join(size_t(camera_lanes), [&](size_t first, size_t last) {
            std::vector<PathVertex> z(size_t(scope.max_edges) + 2);
            static const std::vector<PathVertex> kNoPath;
            for (size_t lane = first; lane < last && !scope.stop.stop_requested(); ++lane)
                for (uint64_t i = lane * kLane; i < std::min(samples, (lane + 1) * kLane); ++i)
                    trace_camera(scope, i, paths > 0 ? light[(i + rotation) % paths] : kNoPath, z.data(), light_lanes + lane, sink);
        });
    }

  private:
    Rgb weighted(const PathContribution& found, const PathView& view) const {
        return found.value * float(mis_weight(view, found.technique, selection.on(view)));
    }

    std::vector<PathVertex> trace_light(const UnitScope& scope, uint64_t m, size_t lane, UnitSink& sink) const {
        const RenderUnit& work = scope.work;
        const Rect& crop = scope.scene.frame().crop;
        std::vector<PathVertex> y(static_cast<size_t>(scope.max_edges));
        LightSampler sampler({scope.seed, Stage::kLight, work.group_first_iteration, work.first_light_path + m});
        y.resize(size_t(trace_light_path(scope.scene, sampler, scope.max_edges, scope.roulette, y.data(), &sink.counters(lane))));
        PathVertex z0;
        PathView view;
        contribute_to_lens(scope.scene, sampler, y.data(), int(y.size()), &z0, &view, &sink.counters(lane),
                           [&](const PathContribution& c, const PathView& v) {
                               sink.splat(lane, uint32_t(crop.index(int(c.film.x), int(c.film.y))), work.first_iteration,
                                          weighted(c, v));
                           });
        return y;
    }

    /// Traces sample i; the samples of a pixel follow one another.
    void trace_camera(const UnitScope& scope, uint64_t i, const std::vector<PathVertex>& y, PathVertex* z, size_t lane,
                      UnitSink& sink) const {
        const Scene& scene = scope.scene;
        const RenderUnit& work = scope.work;
        const uint32_t pixel = uint32_t(i / work.iteration_count);
        const uint64_t iteration = work.first_iteration + i % work.iteration_count;
        const int x = work.tile.x0 + int(pixel) % work.tile.width(), row = work.tile.y0 + int(pixel) / work.tile.width();
        WalkCounters* counters = &sink.counters(lane);
        PathView view;
        Rgb value;
        const auto add = [&](const PathContribution& c, const PathView& v) { value += weighted(c, v); };
        CameraSampler sampler(scope.seed, iteration, uint32_t(scene.frame().crop.index(x, row)));
        const auto visit = [&](int t) {
            contribute_hit<ViewDetail::kFull>(scene, z, t, &view, add);
            if (t > scope.max_edges || !z[t - 1].bsdf.has_smooth_lobe()) return;
            contribute_next_event<ViewDetail::kFull>(scene, z, t, sampler, 1, &view, counters, add);
            for (int s = 2; s <= int(y.size()) && s + t - 1 <= scope.max_edges; ++s) {
                if (!y[size_t(s - 1)].bsdf.has_smooth_lobe()) continue;
                const Rgb c = connect(scene, y.data(), s, z, t, &view, counters);
                if (!c.is_black()) add(from_light_path(c, Technique::connect(s), y.data(), z, t), view);
            }
        };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= scope.max_edges) contribute_escape<ViewDetail::kFull>(scene, z, t, ray, &view, add);
        };
        trace_camera_path(scene, sampler, x, row, scope.max_edges, scope.roulette, z, counters, visit, escape);
        sink.camera(lane, pixel, iteration, value);
    }
};

constexpr ParameterInfo kPlainParameters[] = {kRouletteStart, kRouletteMin};

const AlgorithmInfo kPairingRow{
    .name = kStubPairing,
    .summary = "camera sub-paths paired with light sub-paths of the same unit, for tests",
    .source = "Chaitanya et al. 2018",
    .bias = "unbiased",
    .parameters = kPlainParameters,
    .light_paths_per_pixel = one_light_path,
    .shares_light_paths = true,
    .make = [](const RendererRequest& r) -> Result<std::unique_ptr<Renderer>> {
        return make_unit_renderer(r, [&](auto&& select) {
            const auto selection = select(BdptSelection{double(r.light_paths_per_iteration())});
            return StubPairing<std::remove_cvref_t<decltype(selection)>>{selection};
        });
    },
};

// ---- Splats only: per sample.

struct SplatSelection {
    struct OnPath : PlainTechniques {
        int s_min() const { return view.k; }
        double hit() const { return 0; }
        double next_event() const { return 0; }
        double lens() const { return 1; }
    };
    OnPath on(const PathView& view) const { return {{view}}; }
};

template <class Selection>
struct StubSplats {
    Selection selection;

    float weight(const PathView& view, Technique own) const { return float(mis_weight(view, own, selection.on(view))); }

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        PathVertex* y = context.light_path_vertices;
        PathView view;
        LightSampler sampler({context.seed, Stage::kLight, context.group_iteration, context.light_path});
        const int n = trace_light_path(context.scene, sampler, context.max_edges, context.roulette, y, &context.counters);
        contribute_to_lens(context.scene, sampler, y, n, context.camera_path, &view, &context.counters, contribute);
    }
};

const AlgorithmInfo kSplatsRow{
    .name = kStubSplats,
    .summary = "light sub-paths connected to the lens and nothing else, for tests",
    .source = "Dutre, Lafortune and Willems 1993",
    .bias = "misses what the camera sees directly or through mirrors",
    .parameters = kPlainParameters,
    .traces = Traces::kLight,
    .camera_samples = false,
    .light_paths_per_pixel = one_light_path,
    .make = [](const RendererRequest& r) -> Result<std::unique_ptr<Renderer>> {
        return make_unit_renderer(r, [&](auto&& select) {
            const auto selection = select(SplatSelection{});
            return StubSplats<std::remove_cvref_t<decltype(selection)>>{selection};
        });
    },
};

}  // namespace

bool add_stub_rows() {
    for (const AlgorithmInfo* row : {&kMergingRow, &kPairingRow, &kSplatsRow}) add_to_catalog(*row);
    return true;
}

}  // namespace lightloom::testing
