#include "common/transport/spcbpt_merging.h"

#include "common/core/usable_memory.h"
#include "common/transport/merging_parameters.h"
#include "common/transport/unit_renderer.h"

namespace lightloom {

MergeTerms spcbpt_merge_terms(const AlgorithmSettings& settings, const Scene& scene, int windows) {
    const uint64_t paths =
        std::max(CacheParameters::of(settings).minimum_paths, settings.light_paths_per_iteration(scene.frame().crop.area()));
    return merge_terms_of(settings, scene, double(paths) * windows);
}

Result<std::unique_ptr<Renderer>> make_merging_spcbpt(const RendererRequest& request, const SpcbptSelection& inner,
                                                      std::shared_ptr<const PreparedTables> prepared) {
    const AlgorithmSettings& settings = request.settings.algorithm;
    const CacheParameters p = CacheParameters::of(settings);
    const MergingSelection first{inner, spcbpt_merge_terms(settings, *request.scene, prepared->windows)};
    LL_RETURN_IF_ERROR(check_photon_memory(request, uint64_t(first.terms.paths), usable_memory()));
    return make_unit_renderer(request, [&](auto&& select) {
        using Method = MergingConnections<std::remove_cvref_t<decltype(select)>>;
        return CachedAlgorithm<Method>{Method(select, first, settings.value(kAlpha.name), prepared, p.connections),
                                       heuristic_of(settings), p.minimum_paths};
    });
}

}  // namespace lightloom
