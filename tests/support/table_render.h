#pragma once
// Renders of the methods with a light-vertex cache from given tables, and with some of their techniques switched off.

#include "common/transport/lvcbpt.h"
#include "common/transport/parameters.h"
#include "common/transport/spcbpt.h"
#include "tests/support/estimates.h"
#include "tests/support/random_tables.h"

namespace lightloom::testing {

/// What a render is made with besides its tables.
struct CacheOptions {
    int connections = 3;     ///< N
    uint64_t paths = 1000;   ///< M
    double light_paths = 1;  ///< N1 per pixel and iteration.
    bool ris_aware = false, correlation_aware = false;
};

/// A unit over the whole frame whose plan counts N1 light paths per pixel and iteration.
inline UnitWork frame_with_paths(const Scene& scene, uint32_t samples_per_pixel, double light_paths) {
    UnitWork work = whole_frame(scene, samples_per_pixel);
    work.light_path_count = std::max<uint64_t>(1, uint64_t(std::llround(light_paths * double(work.light_path_count))));
    return work;
}

/// A selection with some techniques switched off; the weights of the others sum to one again.
template <class Base>
struct MaskedCacheSelection : Base {
    bool hits = true, connections_on = true, light_tracing = true;
    int only_s = -1, min_k = 1, max_k = kMaxEdges, max_light_vertices = kMaxEdges;

    int s_max(int k) const { return std::min(Base::s_max(k), max_light_vertices); }
    double connect_factor(const PathView& view, int s) const {
        if (view.k < min_k || view.k > max_k || s > s_max(view.k) || (only_s >= 0 && s != only_s)) return 0;
        const bool on = s == 0 ? hits : s == view.k ? light_tracing : connections_on;
        return on ? Base::connect_factor(view, s) : 0;
    }
};

inline SubspaceSelection subspace_selection(const Scene& scene, SubspaceTables tables, const CacheOptions& o) {
    SubspaceSelection s;
    s.prepared = std::make_shared<const PreparedTables>(std::move(tables));
    s.light_paths_per_iteration = o.light_paths * double(scene.frame().crop.area());
    s.connections = o.connections;
    s.cache_paths = o.ris_aware ? double(o.paths) : 0;
    s.correlation_aware = o.correlation_aware;
    s.survival = TypicalSurvival(RouletteRule{});
    return s;
}

template <class A>
ImageOfSeed cache_image(std::shared_ptr<const Scene> scene, const A& algorithm, int max_depth, uint32_t samples_per_pixel,
                        double light_paths) {
    return [=](uint64_t seed) {
        RenderSettings settings;
        settings.seed = seed;
        settings.max_depth = max_depth;
        const Result<Partial> partial =
            render_unit(algorithm, *scene, settings, {}, frame_with_paths(*scene, samples_per_pixel, light_paths), {});
        if (!partial.ok()) throw std::runtime_error(partial.status().message());
        EXPECT_EQ(partial->dropped_count, 0u);
        return develop(*partial, scene->frame().crop);
    };
}

inline ImageOfSeed spcbpt_image(const std::shared_ptr<const Scene>& scene, SubspaceTables tables, const CacheOptions& o,
                                int max_depth, uint32_t samples_per_pixel) {
    const SpcbptAlgorithm<> algorithm{
        {subspace_selection(*scene, std::move(tables), o), o.connections}, Heuristic::kBalance, o.paths};
    return cache_image(scene, algorithm, max_depth, samples_per_pixel, o.light_paths);
}

inline ImageOfSeed lvcbpt_image(const std::shared_ptr<const Scene>& scene, double vertices_per_path, const CacheOptions& o,
                                int max_depth, uint32_t samples_per_pixel) {
    const UniformSelection selection{o.light_paths * double(scene->frame().crop.area()), o.connections / vertices_per_path,
                                     TypicalSurvival(RouletteRule{})};
    const LvcbptAlgorithm<> algorithm{{selection, o.connections}, Heuristic::kBalance, o.paths};
    return cache_image(scene, algorithm, max_depth, samples_per_pixel, o.light_paths);
}

/// Estimates of the path lengths 1 .. max_length, each from an image of its own, by a method of the catalog with tables. (Its
/// images of different depths share no samples, so that their difference is far noisier than the length.)
inline std::vector<RegionMeans> lengths_with_tables(const std::shared_ptr<const Scene>& scene, const std::string& name,
                                                    int max_length, uint32_t samples_per_pixel, int seeds, uint64_t first_seed) {
    std::vector<RegionMeans> lengths(static_cast<size_t>(max_length));
    for (uint64_t seed = first_seed; seed < first_seed + uint64_t(seeds); ++seed) {
        const RenderSettings settings{name, with_small_training(name, {}), seed, max_length - 1};
        TrainingReport report;
        Result<SubspaceTables> tables = make_tables(*scene, settings, {}, &report);
        const Result<TransportParameters> p = TransportParameters::read(settings);
        if (!tables.ok() || !p.ok()) throw std::runtime_error("no tables for " + name);
        CacheOptions options;
        options.connections = p->connections, options.paths = p->minimum_paths;
        options.light_paths = p->light_paths, options.ris_aware = p->ris_aware;
        options.correlation_aware = p->correlation_aware;
        const double vertices = tables->vertices_per_path, frame_paths = p->light_paths * double(scene->frame().crop.area());
        const MaskedCacheSelection<UniformSelection> uniform{
            {frame_paths, p->connections / vertices, TypicalSurvival(RouletteRule{})}};
        const MaskedCacheSelection<SubspaceSelection> subspaces{subspace_selection(*scene, *std::move(tables), options)};
        const auto render = [&](auto selection, auto make, int k) {
            selection.min_k = selection.max_k = k;
            const auto image = cache_image(scene, make(selection), k - 1, samples_per_pixel, options.light_paths);
            lengths[size_t(k - 1)].add(image(seed), scene->frame().crop);
        };
        for (int k = 1; k <= max_length; ++k) {
            if (name == "lvcbpt")
                render(
                    uniform,
                    [&](const auto& s) {
                        return LvcbptAlgorithm<MaskedCacheSelection<UniformSelection>>{
                            {s, p->connections}, p->heuristic, p->minimum_paths};
                    },
                    k);
            else if (name == "spcbpt")
                render(
                    subspaces,
                    [&](const auto& s) {
                        return SpcbptAlgorithm<MaskedCacheSelection<SubspaceSelection>>{
                            {s, p->connections}, p->heuristic, p->minimum_paths};
                    },
                    k);
            else
                throw std::runtime_error("no masked selection for '" + name + "' yet: add it here");
        }
    }
    return lengths;
}

}  // namespace lightloom::testing
