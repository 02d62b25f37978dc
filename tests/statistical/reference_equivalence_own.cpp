// Our own algorithms among themselves: `light` against `bdpt`, and the energy that `bdpt` makes only by hitting emitters.

#include <cstdio>
#include <fstream>

#include "common/transport/bdpt.h"
#include "common/transport/unit_loop.h"
#include "tests/statistical/reference_equivalence.h"
#include "tests/support/hits_only.h"

namespace lightloom::equivalence {
namespace {

/// bdpt on the paths that light tracing can splat, whose vertex next to the lens is no Dirac one: every technique of the others
/// has the density zero, and the weights inside the class stay as they are.
struct SplattablePaths : BdptSelection {
    struct OnPath : BdptSelection::OnPath {
        double hit() const { return counts() * BdptSelection::OnPath::hit(); }
        double next_event() const { return counts() * BdptSelection::OnPath::next_event(); }
        double connect(int s) const { return counts() * BdptSelection::OnPath::connect(s); }
        double lens() const { return counts() * BdptSelection::OnPath::lens(); }

      private:
        double counts() const { return view.k >= 2 && view.delta[view.k - 1] ? 0 : 1; }
    };
    OnPath on(const PathView& view) const { return OnPath{BdptSelection::on(view)}; }
};

/// A walk from the camera that counts those paths alone.
struct HitsOnly {
    float weight(const PathView& view, Technique) const { return testing::by_hits_only(view) ? 1 : 0; }

    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        PathVertex* z = context.camera_path;
        PathView view;
        CameraSampler sampler(context.seed, context.iteration, context.pixel);
        const auto visit = [&](int t) { contribute_hit<ViewDetail::kFull>(context.scene, z, t, &view, contribute); };
        const auto escape = [&](int t, const WalkRay& ray) {
            if (t <= context.max_edges) contribute_escape<ViewDetail::kFull>(context.scene, z, t, ray, &view, contribute);
        };
        trace_camera_path(context.scene, sampler, context.px, context.py, context.max_edges, context.roulette, z, &context.counters,
                          visit, escape);
    }
};

template <UnitAlgorithm A>
RenderGroup group_of(const LoadedScene& loaded, const A& algorithm, uint64_t seed) {
    return [=, scene = loaded.scene, max_edges = loaded.max_depth + 1](const RenderUnit& work) {
        return render_unit(algorithm, *scene, seed, max_edges, RouletteRule{}, work, {});
    };
}

}  // namespace

Result<RatioInterval> light_against_bdpt(const Options& options, const LoadedScene& loaded, double level,
                                         nlohmann::ordered_json* line) {
    auto light = catalog_group(loaded, "light", options.seed);
    if (!light.ok()) return light.status();
    // Most of the time for the noisier side, the same share in every scene: shares that followed the samples would bias the
    // means. The seeds differ, because the two estimates have to be independent.
    constexpr double kLightShare = 0.85;
    const auto never = [](const Rendering&) { return false; };
    auto a = render_groups(*loaded.scene, *light, options.seconds * kLightShare, never);
    if (!a.ok()) return a.status();
    BdptAlgorithm<SplattablePaths> bdpt;
    bdpt.selection.light_paths_per_iteration = double(loaded.scene->frame().crop.area());
    auto b = render_groups(*loaded.scene, group_of(loaded, bdpt, options.seed + 1), options.seconds * (1 - kLightShare), never);
    if (!b.ok()) return b.status();
    (*line)["light_spp"] = a->iterations;
    (*line)["bdpt_spp"] = b->iterations;
    return ratio_interval(a->mean(kImage), b->mean(kImage), level);
}

Status print_missing_energy(const Options& options) {
    // Small beside everything in these scenes, large enough to be hit.
    constexpr float kRadius = 0.05f;
    const std::vector<std::string> names =
        options.only.empty() ? std::vector<std::string>{"sds-glass-sphere-mirror", "striped-caustics"} : options.only;
    std::ofstream json(options.json, std::ios::app);
    std::printf("%-26s %-18s %10s %12s  %s\n", "scene", "lights", "bdpt mean", "by hits only", "share [95 % interval]");
    for (const std::string& name : names) {
        auto as_is = load_scene(options, name, "240x180");
        auto hittable = load_scene(options, name, "240x180", kRadius);
        if (!as_is.ok()) return as_is.status();
        if (!hittable.ok()) return hittable.status();
        auto bdpt = catalog_group(*as_is, "bdpt", options.seed);
        if (!bdpt.ok()) return bdpt.status();
        const auto never = [](const Rendering&) { return false; };
        auto total = render_groups(*as_is->scene, *bdpt, options.seconds / 4, never);
        if (!total.ok()) return total.status();
        auto hits = render_groups(*hittable->scene, group_of(*hittable, HitsOnly{}, options.seed), options.seconds * 3 / 4, never);
        if (!hits.ok()) return hits.status();
        const bool points = !as_is->scene->description().point_lights.empty();
        // Of the whole light: where the lights are points, bdpt's mean lacks what only hits can make.
        const double own = total->mean(kImage).mean;
        const Estimate by_hits = hits->mean(kImage);
        const double only = by_hits.mean;
        const double all = points ? own + only : own;
        const double error = student_quantile(sidak(0.05, int(names.size())), by_hits.degrees) * by_hits.standard_error();
        std::printf("%-26s %-18s %10.5f %12.6f  %.5f [%.5f, %.5f]\n", name.c_str(), points ? "points (missing)" : "can be hit", own,
                    only, only / all, (only - error) / all, (only + error) / all);
        std::fflush(stdout);
        if (!options.json.empty())
            json << nlohmann::ordered_json{{"scene", name},
                                           {"missing", points},
                                           {"bdpt_mean", own},
                                           {"hits_only_mean", only},
                                           {"share", only / all},
                                           {"low", (only - error) / all},
                                           {"high", (only + error) / all}}
                        .dump()
                 << std::endl;
    }
    return {};
}

}  // namespace lightloom::equivalence
