#include "client/bench/measured_render.h"

namespace lightloom::client {

RenderCost LocalRender::cost() const {
    const UnitCounters& counters = render_.counters();
    return {.iterations = render_.iterations(),
            .seconds = render_.seconds(),
            .preparation_seconds = render_.preparation_seconds(),
            .groups = render_.groups(),
            .cpu_seconds = render_.cpu_seconds(),
            .vertices = counters.vertices,
            .connections = counters.connections,
            .tables = tables_,
            .camera_samples = counters.camera_samples,
            .light_paths = counters.light_paths,
            .rays = counters.rays,
            .dropped = render_.dropped()};
}

std::optional<RareLightReport> LocalRender::rare_light(double image_mean) const {
    if (!rare_.known()) return std::nullopt;
    return RareLightReport::of(rare_, double(render_.counters().camera_samples), image_mean, exposure_);
}

}  // namespace lightloom::client
