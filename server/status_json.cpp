#include "server/status_json.h"

#include <nlohmann/json.hpp>

#include "server/results.h"

namespace lightloom {
namespace {

using Json = nlohmann::ordered_json;

Json positive(auto number) { return number > 0 ? Json(number) : Json(nullptr); }

}  // namespace

Json status_json(const JobInfo& j) {
    const bool framed = !j.spec.frame.crop.empty();  // it is once the scene was read
    return {{"job", j.job_id},
            {"name", j.label.name},
            {"owner", j.label.owner},
            {"scene", j.scene},
            {"algorithm", j.algorithm},
            {"width", positive(framed ? j.spec.frame.crop.width() : j.spec.width)},
            {"height", positive(framed ? j.spec.frame.crop.height() : j.spec.height)},
            {"samples_per_pixel", positive(j.spec.samples_per_pixel)},
            {"time_limit_seconds", positive(j.spec.time_limit_seconds)},
            {"noise_target", positive(j.spec.noise_target)},
            {"state", to_string(j.state)},
            {"message", j.message},
            {"phase", j.state == JobState::kPreparing ? Json(phase_text(j)) : Json(nullptr)},
            {"phase_done", j.phase_done},
            {"phase_total", j.phase_total},
            {"progress", rendered_share(j)},
            {"units_done", j.unit_done},
            {"units_total", positive(j.unit_total)},
            {"units_leased", j.unit_leased},
            {"samples_per_pixel_done", j.samples_per_pixel_done},
            {"prepare_seconds", j.prepare_seconds},
            {"render_seconds", j.render_seconds},
            {"eta_seconds", j.eta_seconds >= 0 ? Json(j.eta_seconds) : Json(nullptr)},
            {"age_seconds", j.age_seconds},
            {"dropped_samples", j.dropped_samples},
            {"rare_light", to_json(j.rare_light)},
            {"noise", to_json(j.noise, j.spec.noise_target)},
            {"workers", j.worker_count},
            {"duplicates_different", j.duplicates_different}};
}

Json status_json(const WorkerStatus& w) {
    Json unit;
    if (w.in_work) {
        unit = {{"job", w.in_work->job_id},
                {"training", w.in_work->key.kind != UnitKind::kRender},
                {"round", w.in_work->key.round},
                {"group", w.in_work->key.group},
                {"tile", w.in_work->key.tile}};
    }
    return {{"worker", w.worker_id},
            {"host", w.host},
            {"process_id", w.process_id},
            {"threads", w.thread_count},
            {"state", to_string(w.state)},
            {"note", w.note},
            {"unit", std::move(unit)},
            {"units_merged", w.units_merged},
            {"units_held", w.units_held},
            {"samples_per_second", positive(w.samples_per_second)},
            {"seconds_since_heard", w.seconds_since_heard},
            {"lost", w.state == WorkerState::kGone}};
}

std::string status_text(const Json& status, int indent) {
    return status.dump(indent, ' ', false, Json::error_handler_t::replace);  // the default is to throw
}

}  // namespace lightloom
