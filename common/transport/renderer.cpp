#include "common/transport/renderer.h"

namespace lightloom {

Result<std::unique_ptr<Renderer>> Renderer::create(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                   const Tables& tables, const TechniqueMask* mask) {
    LL_RETURN_IF_ERROR(check_depth(settings.max_depth));
    const AlgorithmInfo& info = settings.algorithm.info();
    if (info.learning) {
        if (tables.empty()) return failed_precondition("algorithm '" + settings.algorithm.name() + "' needs its tables");
        const bool others = !tables.algorithm().empty() && tables.algorithm() != info.name;
        if (others || !tables.consist_of(info.learning->parts))
            return failed_precondition("the tables are not those of algorithm '" + settings.algorithm.name() + "'");
        LL_RETURN_IF_ERROR(tables.validate(scene->emitters()));
    } else if (!tables.empty()) {
        return failed_precondition("algorithm '" + settings.algorithm.name() + "' reads no tables");
    }
    return info.make({std::move(scene), settings, tables, mask});
}

}  // namespace lightloom
