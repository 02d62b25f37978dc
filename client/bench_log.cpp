#include "client/bench_log.h"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "common/core/digest.h"
#include "common/film/atomic_file.h"

namespace lightloom::client {
namespace {

/// Whether a line of a benchmark begins like this, however little of it was written.
bool begins_a_line(std::string_view text) {
    constexpr std::string_view kBegin = "{\"run\":\"";
    const size_t common = std::min(text.size(), kBegin.size());
    return text.substr(0, common) == kBegin.substr(0, common);
}

}  // namespace

Json BenchRun::json() const {
    return {{"scene_digest", scene_digest},
            {"reference_digest", reference_digest},
            {"algorithm", algorithm.name},
            {"parameters", algorithm.parameters},
            {"width", width},
            {"height", height},
            {"max_depth", max_depth},
            {"seed", seed},
            {"threads", threads},
            {"time_limit", time_limit},
            {"iteration_limit", iteration_limit},
            {"threshold_percent", threshold},
            {"stop_after", stop_after},
            {"build", build}};
}

std::string BenchRun::key() const { return sha256(json().dump()).hex().substr(0, 16); }

Json checkpoint_line(Json run_line, const ProgressiveRender& render, const Metrics& metrics) {
    const UnitCounters& counters = render.counters();
    run_line["iterations"] = render.iterations();
    run_line["groups"] = render.groups();
    run_line["seconds"] = render.seconds();
    run_line["cpu_seconds"] = render.cpu_seconds();
    run_line["preparation_seconds"] = render.preparation_seconds();
    run_line["mape_percent"] = metrics.mape;
    run_line["mape_unclamped_percent"] = metrics.mape_unclamped;
    run_line["relmse"] = metrics.relmse;
    run_line["relmse_trimmed"] = metrics.relmse_trimmed;
    run_line["trim_percent"] = metrics.trim_percent;
    run_line["mean_ratio"] = metrics.mean_ratio;
    run_line["camera_samples"] = counters.camera_samples;
    run_line["light_paths"] = counters.light_paths;
    run_line["rays"] = counters.rays;
    run_line["vertices"] = counters.vertices;
    run_line["connections"] = counters.connections;
    run_line["dropped_samples"] = render.dropped();
    return run_line;
}

Json done_line(Json end, std::span<const CurvePoint> curve, double threshold) {
    end["done"] = true;
    const auto crossing = find_crossing(curve, threshold);
    const bool capped = !crossing || crossing->kind == Crossing::Kind::kExtrapolated;
    end["capped"] = capped;
    if (!crossing) return end;
    Json where{{"iterations", crossing->iterations}, {"seconds", crossing->seconds}};
    if (crossing->kind == Crossing::Kind::kAtMost) where["at_most"] = true;
    if (crossing->lower_bound) where["lower_bound"] = true;
    end[capped ? "extrapolated" : "reached"] = std::move(where);
    return end;
}

Result<BenchHistory> parse_history(std::string_view text, const std::string& file_name, const std::set<std::string>& keys) {
    BenchHistory history;
    std::vector<std::pair<std::string, std::string_view>> lines;  // Key of the run and text.
    for (size_t begin = 0, number = 1; begin < text.size(); ++number) {
        const size_t newline = text.find('\n', begin);
        const bool whole = newline != std::string_view::npos;
        const std::string_view line = text.substr(begin, whole ? newline - begin : std::string_view::npos);
        begin += line.size() + (whole ? 1 : 0);
        if (line.empty()) continue;
        Json json = Json::parse(line, nullptr, false);
        const auto run = json.is_object() ? json.find("run") : json.end();
        if (!json.is_object() || run == json.end() || !run->is_string()) {
            if (!whole && json.is_discarded() && begins_a_line(line)) break;  // what a killed benchmark was writing
            return invalid_argument(file_name + ":" + std::to_string(number) +
                                    ": not a line of a benchmark; repair the file or give another name");
        }
        const std::string key = *run;
        lines.emplace_back(key, line);
        if (const auto done = json.find("done"); done != json.end() && *done == true) history.done[key] = std::move(json);
    }
    for (const auto& [key, line] : lines) {
        if (!keys.contains(key) || history.done.contains(key)) history.kept.append(line) += '\n';
    }
    return history;
}

Result<BenchWriter> BenchWriter::open(const std::string& path, std::string_view content) {
    LL_RETURN_IF_ERROR(write_file_atomically(path, content));
    std::FILE* file = std::fopen(path.c_str(), "a");
    if (!file) return invalid_argument(path + ": cannot be written: " + std::generic_category().message(errno));
    return BenchWriter(path, file);
}

Status BenchWriter::append(const Json& line) {
    const std::string text = line.dump() + "\n";
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) == text.size() && std::fflush(file_.get()) == 0) return {};
    return {StatusCode::kResourceExhausted, path_ + ": cannot be written: " + std::generic_category().message(errno)};
}

}  // namespace lightloom::client
