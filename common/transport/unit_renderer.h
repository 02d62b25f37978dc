#pragma once
// Makes a Renderer of an algorithm of one of the three shapes (unit_loop.h). Only the files of algorithms include this.

#include <tbb/task_arena.h>

#include "common/core/check.h"
#include "common/transport/parameters.h"
#include "common/transport/rare_light.h"
#include "common/transport/renderer.h"
#include "common/transport/unit_loop.h"

namespace lightloom {
namespace detail {

using See = std::function<void(const SeenContribution&)>;

/// Whether an algorithm fills in the subspace labels of the paths that it finds.
template <class A>
consteval bool labels_paths() {
    if constexpr (requires { std::remove_cvref_t<decltype(std::declval<const A&>().method)>::kDetail; })
        return std::remove_cvref_t<decltype(std::declval<const A&>().method)>::kDetail == ViewDetail::kSubspace;
    return false;
}

/// Wraps an algorithm and shows each of its contributions to `see`.
template <class A>
struct Watched {
    const A& inner;
    const See& see;

    static constexpr bool kPerIteration = prepares_per_iteration<A>();
    /// Without this, and for paths of one edge, a view's labels are leftovers of earlier paths.
    static constexpr bool kLabels = labels_paths<A>();

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const requires UnitAlgorithm<A> {
        inner.trace(context, [&](const PathContribution& c, PathView& view) {
            show(context, c, view, inner.weight(view, c.technique));
            contribute(c, view);
        });
    }
    float weight(const PathView& view, Technique own) const requires UnitAlgorithm<A> { return inner.weight(view, own); }

    template <class Contribute>
    auto prepare(const UnitScope& scope, UnitPreparation* preparation,
                 Contribute&& contribute) const requires PreparedAlgorithm<A> {
        const Rect& crop = scope.scene.frame().crop;
        return inner.prepare(scope, preparation, [&](const PathContribution& c, PathView& view, float w, uint64_t m, auto& chunk) {
            const uint32_t pixel = uint32_t(crop.index(int(c.film.x), int(c.film.y)));
            see({c, view, double(w), pixel, scope.work.first_iteration, kLabels && view.k >= 2});
            contribute(c, view, w, m, chunk);
        });
    }
    template <class State, class Contribute>
    void trace(SampleContext& context, const State& state, Contribute&& contribute) const requires PreparedAlgorithm<A> {
        inner.trace(context, state, [&](const PathContribution& c, PathView& view) {
            show(context, c, view, inner.weight(state, view, c.technique));
            contribute(c, view);
        });
    }
    template <class State>
    float weight(const State& state, const PathView& view, Technique own) const requires PreparedAlgorithm<A> {
        return inner.weight(state, view, own);
    }

  private:
    void show(const SampleContext& context, const PathContribution& c, const PathView& view, float weight) const {
        const Rect& crop = context.scene.frame().crop;
        const uint32_t pixel = c.technique.splats() ? uint32_t(crop.index(int(c.film.x), int(c.film.y))) : context.pixel;
        see({c, view, double(weight), pixel, context.iteration, kLabels && view.k >= 2});
    }
};

/// Weights of an algorithm without labels, which depend on a path's view alone.
template <class Selection>
struct PlainWeights : PathWeights {
    Selection selection;
    Heuristic heuristic;

    PlainWeights(Selection s, Heuristic h) : selection(std::move(s)), heuristic(h) {}
    void label_light_path(const Scene&, PathVertex*, int) const override {}
    void label_camera_vertex(const Scene&, PathVertex*) const override {}
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3&,
                  PathView* view) const override {
        view_footprint(scene.emitters(), y, s, z, t, view);
    }
    double sigma(const PathView& view, Technique t) const override { return lightloom::sigma(selection.on(view), t); }
    double weight(const PathView& view, Technique own) const override {
        return mis_weight(view, own, selection.on(view), heuristic);
    }
};

/// Weights of an algorithm with a method of cached.h.
template <class Method>
struct CachedWeights : PlainWeights<std::remove_cvref_t<decltype(std::declval<const Method&>().densities)>> {
    Method method;

    CachedWeights(const Method& m, Heuristic h)
        : PlainWeights<std::remove_cvref_t<decltype(m.densities)>>(m.densities, h),
          method(m) {}
    void label_light_path(const Scene& scene, PathVertex* y, int n) const override { method.label_light_path(scene, y, n); }
    void label_camera_vertex(const Scene& scene, PathVertex* v) const override { method.label_camera_vertex(scene, v); }
    void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                  PathView* view) const override {
        view_footprint(scene.emitters(), y, s, z, t, view);
        method.complete(scene, y, s, z, t, towards, view);
    }
};

template <class A>
std::unique_ptr<PathWeights> weights_of(const A& a) {
    if constexpr (requires { a.method.densities; }) {
        return std::make_unique<CachedWeights<std::remove_cvref_t<decltype(a.method)>>>(a.method, a.heuristic);
    } else if constexpr (requires { a.selection; }) {
        Heuristic heuristic = Heuristic::kBalance;
        if constexpr (requires { a.heuristic; }) heuristic = a.heuristic;
        return std::make_unique<PlainWeights<std::remove_cvref_t<decltype(a.selection)>>>(a.selection, heuristic);
    } else {
        return nullptr;
    }
}

template <class A>
class UnitRenderer final : public Renderer {
  public:
    UnitRenderer(const RendererRequest& request, A algorithm)
        : scene_(request.scene),
          settings_(request.settings),
          roulette_(roulette_of(request.settings.algorithm)),
          gain_(request.gain),
          algorithm_(std::move(algorithm)) {
        roulette_.gain = gain_.get();
        // Checks the catalog's row against the algorithm, as far as the algorithm's type shows it.
        const AlgorithmInfo& info = settings_.algorithm.info();
        const double light_paths = settings_.algorithm.light_paths_per_pixel();
        LL_CHECK(settings_.algorithm.frame() == FrameShape::kWhole || !(has_unit_selection<A>() || prepares_per_iteration<A>()));
        if constexpr (UnitAlgorithm<A>)
            LL_CHECK(!info.shares_light_paths && (light_paths == 0 || light_paths == 1),
                     "an algorithm that is asked sample by sample has one light path for each, or none");
        else
            LL_CHECK(info.shares_light_paths == (light_paths > 0), "the light paths of such an algorithm are the unit's");
    }

    Result<Partial> render(const RenderUnit& work, std::stop_token stop) const override {
        LL_RETURN_IF_ERROR(check_shape(work));
        return render_unit(algorithm_, *scene_, settings_.seed, settings_.max_edges(), roulette_, work, std::move(stop));
    }

    Result<Partial> watch(const RenderUnit& work, const See& see, std::stop_token stop) const override {
        LL_RETURN_IF_ERROR(check_shape(work));
        const auto run = [&](const auto& algorithm) {
            tbb::task_arena one_thread(1);
            return one_thread.execute(
                [&] { return render_unit(algorithm, *scene_, settings_.seed, settings_.max_edges(), roulette_, work, stop); });
        };
        if constexpr (OwnedAlgorithm<A>)
            return run(algorithm_);
        else
            return run(Watched<A>{algorithm_, see});
    }

    RareLight rare_light(std::stop_token stop) const override { return estimate_rare_light(*scene_, settings_, std::move(stop)); }

    std::unique_ptr<PathWeights> weights() const override { return weights_of(algorithm_); }

  private:
    Status check_shape(const RenderUnit& work) const {
        const AlgorithmInfo& info = settings_.algorithm.info();
        const std::string name = "algorithm '" + settings_.algorithm.name() + "' ";
        if (settings_.algorithm.frame() == FrameShape::kWhole && work.owner() != scene_->frame().crop)
            return invalid_argument(name + "renders units of the whole frame, not tiles of it");
        if (info.camera_samples == work.splats_only)
            return invalid_argument(name + (work.splats_only ? "makes camera samples, and the unit has none"
                                                             : "only splats, and the unit asks for camera samples"));
        if (!info.light_paths_per_pixel && work.light_path_count > 0)
            return invalid_argument(name + "traces no light paths, and the unit asks for some");
        return {};
    }

    std::shared_ptr<const Scene> scene_;
    RenderSettings settings_;
    RouletteRule roulette_;
    std::shared_ptr<const GainTable> gain_;
    A algorithm_;
};

}  // namespace detail

/// Makes the renderer of the algorithm `make(select)`, where `select(selection)` is that selection without the
/// techniques that the request leaves out. An algorithm that makes a selection for each unit keeps a copy of `select`.
template <class Make>
std::unique_ptr<Renderer> make_unit_renderer(const RendererRequest& request, Make&& make) {
    const auto finish = [&](auto algorithm) -> std::unique_ptr<Renderer> {
        return std::make_unique<detail::UnitRenderer<decltype(algorithm)>>(request, std::move(algorithm));
    };
    if (!request.mask) return finish(make([](auto selection) { return selection; }));
    return finish(make([mask = *request.mask](auto selection) { return Masked<decltype(selection)>{std::move(selection), mask}; }));
}

}  // namespace lightloom
