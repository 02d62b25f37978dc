#include "client/bench/run_lines.h"

#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "common/core/digest.h"
#include "common/metrics/stability.h"
#include "server/results.h"

namespace lightloom::client {
namespace {

/// An error this many times the reference's own is still an error of the run; below, the two are hard to tell apart.
constexpr double kNearFloor = 4;

Json machine_json() {
    Json machine;
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);) {
        if (line.rfind("model name", 0) != 0) continue;
        machine["processor"] = line.substr(std::min(line.find(": ") + 2, line.size()));
        break;
    }
    machine["logical_processors"] = ::sysconf(_SC_NPROCESSORS_ONLN);
    struct sysinfo info {};
    if (::sysinfo(&info) == 0) machine["memory_bytes"] = uint64_t(info.totalram) * info.mem_unit;
    utsname name{};
    if (::uname(&name) == 0) machine["system"] = std::string(name.sysname) + " " + name.release + " " + name.machine;
    return machine;
}

template <class Value>
void set(Json& json, const char* key, const std::optional<Value>& value) {
    if (value) json[key] = *value;
}

}  // namespace

Json BenchRun::json() const {
    Json json{{"scene", scene},
              {"scene_digest", scene_digest},
              {"reference_digest", reference_digest},
              {"algorithm", algorithm.settings.name()},
              {"parameters", algorithm.settings.named_text()},
              {"width", width},
              {"height", height},
              {"max_depth", max_depth},
              {"seed", seed},
              {"threads", threads},
              {"budget", budget.json()},
              {"build", build}};
    if (threshold > 0) json["threshold_percent"] = threshold;
    if (stop_after >= 0) json["stop_after"] = stop_after;
    // A line says in "tables" what became of them in its run.
    if (!tables.empty()) json["table_source"] = tables;
    if (!server.empty()) json["server"] = server;
    return json;
}

std::string BenchRun::key() const { return sha256(line_text(json())).hex().substr(0, 16); }

Json BenchRun::line(const char* type) const {
    Json line{{"type", type}, {"run", key()}, {"label", algorithm.label}};
    line.update(json());
    return line;
}

Json start_line(const Suite& suite, const StartLine& start) {
    Json line{{"type", "start"},
              {"format", kResultsFormat},
              {"suite", suite.name},
              {"description", suite.description},
              {"suite_digest", suite.digest},
              {"suite_seconds", start.suite_seconds},
              {"utc", utc_now()},
              {"build", start.build},
              {"machine", machine_json()},
              {"threads", start.threads},
              {"stability", suite.stability}};
    if (!start.server.empty()) line["server"] = start.server;
    if (start.budget_seconds > 0) line["budget_seconds"] = start.budget_seconds;
    return line;
}

Json scene_line(const SuiteScene& scene, const BenchRun& run, const Reference& reference, const std::string& reference_image) {
    Json line{{"type", "scene"},
              {"scene", scene.name},
              {"file", scene.job.scene},
              {"scene_digest", run.scene_digest},
              {"width", run.width},
              {"height", run.height},
              {"max_depth", run.max_depth},
              {"claim", scene.claim},
              {"reference", reference.path},
              {"reference_digest", reference.digest},
              {"reference_scene_digest", reference.image.attribute(exr_attribute::kScene)},
              {"reference_algorithm", reference.image.attribute(exr_attribute::kAlgorithm)}};
    const std::string samples = reference.image.attribute(exr_attribute::kSamples);
    if (!samples.empty()) line["reference_samples_per_pixel"] = std::strtoull(samples.c_str(), nullptr, 10);
    set(line, "reference_mape_percent", reference.noise_mape);
    set(line, "reference_relmse", reference.noise_relmse);
    Json& regions = line["reference_regions"] = Json::array();
    for (const Estimate& region : reference.regions) {
        regions.push_back({{"mean", region.mean}});
        if (std::isfinite(region.variance)) regions.back()["variance"] = region.variance;
    }
    if (!reference_image.empty()) line["reference_image"] = reference_image;
    return line;
}

Json checkpoint_line(const BenchRun& run, const MeasuredRender& render, const Metrics& metrics, const Reference& reference,
                     double suite_seconds) {
    Json line = run.line("checkpoint");
    const RenderCost cost = render.cost();
    if (!cost.tables.empty()) line["tables"] = cost.tables;
    line["iterations"] = cost.iterations;
    set(line, "groups", cost.groups);
    line["seconds"] = cost.seconds;
    set(line, "cpu_seconds", cost.cpu_seconds);
    line["preparation_seconds"] = cost.preparation_seconds;
    line["suite_seconds"] = suite_seconds;
    line["mape_percent"] = metrics.mape;
    line["mape_unclamped_percent"] = metrics.mape_unclamped;
    line["relmse"] = metrics.relmse;
    line["relmse_trimmed"] = metrics.relmse_trimmed;
    line["trim_percent"] = metrics.trim_percent;
    line["mean_ratio"] = metrics.mean_ratio;
    if (reference.noise_relmse) {
        line["relmse_own"] = metrics.relmse - *reference.noise_relmse;
        if (metrics.relmse < kNearFloor * *reference.noise_relmse) line["near_floor"] = true;
    }
    if (const auto noise = render.noise()) {
        line["estimated_relmse"] = noise->relmse;
        line["estimated_relmse_error"] = noise->error;
    }
    line["camera_samples"] = cost.camera_samples;
    line["light_paths"] = cost.light_paths;
    line["rays"] = cost.rays;
    set(line, "vertices", cost.vertices);
    set(line, "connections", cost.connections);
    line["dropped_samples"] = cost.dropped;
    return line;
}

void add_crossing(Json& line, std::span<const CurvePoint> curve, double threshold) {
    const auto crossing = find_crossing(curve, threshold);
    const bool capped = !crossing || crossing->kind == Crossing::Kind::kExtrapolated;
    line["capped"] = capped;
    if (!crossing) return;
    Json where{{"iterations", crossing->iterations}, {"seconds", crossing->seconds}};
    if (crossing->kind == Crossing::Kind::kAtMost) where["at_most"] = true;
    if (crossing->lower_bound) where["lower_bound"] = true;
    line[capped ? "extrapolated" : "reached"] = std::move(where);
}

Json run_line(Json line, const BenchRun& run, const RunEnd& end) {
    line["type"] = "run";
    line["region_means"] = luminance_means(end.image, kRegionColumns, kRegionRows);
    const Fireflies fireflies = find_fireflies(end.image, end.reference);
    line["fireflies"] = {{"count", fireflies.count}, {"energy", fireflies.energy}};
    if (run.threshold > 0) add_crossing(line, end.curve, run.threshold);
    if (!end.image_file.empty()) line["image"] = end.image_file;
    if (end.given_seconds) line["cut"] = {{"asked", run.budget.json()}, {"given_seconds", *end.given_seconds}};
    if (end.rare_light) {
        line["rare_light"] = {{"share", end.rare_light->share},
                              {"unreachable_share", end.rare_light->unreachable_share},
                              {"expected_hits", end.rare_light->expected_hits},
                              {"mean_error", end.rare_light->mean_error}};
    }
    return line;
}

Json cut_line(const std::string& scene, const std::string& what) { return {{"type", "cut"}, {"scene", scene}, {"what", what}}; }

}  // namespace lightloom::client
