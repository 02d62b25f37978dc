#include "common/transport/renderer.h"

#include "common/tables/emission_part.h"
#include "common/tables/gain_part.h"
#include "common/transport/parameters.h"

namespace lightloom {

std::shared_ptr<const Scene> lit_scene(std::shared_ptr<const Scene> scene, const Tables& tables) {
    auto emission = emission_of(tables);
    if (!emission) return scene;
    std::unique_ptr<const Scene> guided = scene->with_emission(std::move(emission));
    // The guided scene shares the geometry of the other one, which lives as long.
    return {guided.release(), [base = std::move(scene)](const Scene* s) { delete s; }};
}

Result<std::unique_ptr<Renderer>> Renderer::create(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                   const Tables& tables, const TechniqueMask* mask) {
    LL_RETURN_IF_ERROR(check_depth(settings.max_depth));
    const AlgorithmInfo& info = settings.algorithm.info();
    if (const LearningInfo* learning = settings.algorithm.learning()) {
        if (tables.empty()) return failed_precondition("algorithm '" + settings.algorithm.name() + "' needs its tables");
        const bool others = !tables.algorithm().empty() && tables.algorithm() != info.name;
        if (others || !tables.consist_of(learning->parts))
            return failed_precondition("the tables are not those of algorithm '" + settings.algorithm.name() + "'");
        LL_RETURN_IF_ERROR(tables.validate(scene->emitters()));
    } else if (!tables.empty()) {
        return failed_precondition("algorithm '" + settings.algorithm.name() + "' reads no tables");
    }
    auto gain = gain_of(tables, scene->frame().crop);
    if (!gain.ok()) return gain.status();
    std::optional<TechniqueMask> techniques = techniques_of(settings.algorithm);
    if (techniques && mask) techniques = mask->both(*techniques);
    return info.make({lit_scene(std::move(scene), tables), settings, tables, techniques ? &*techniques : mask, *std::move(gain)});
}

}  // namespace lightloom
