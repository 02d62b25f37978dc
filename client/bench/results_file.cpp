#include "client/bench/results_file.h"

#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "common/core/atomic_file.h"
#include "common/core/digest.h"

namespace lightloom::client {
namespace {

/// Whether a line of a benchmark begins like this, however little of it was written.
bool begins_a_line(std::string_view text) {
    constexpr std::string_view kBegin = "{\"run\":\"";
    const size_t common = std::min(text.size(), kBegin.size());
    return text.substr(0, common) == kBegin.substr(0, common);
}

Status cannot_be_written(const std::string& path, int error) {
    return invalid_argument(path + ": cannot be written: " + std::generic_category().message(error));
}

/// Whether a failed lock says that the file system has none, as some network file systems.
bool has_no_locks(int error) { return error == ENOSYS || error == EOPNOTSUPP || error == ENOLCK; }

}  // namespace

Json BenchRun::json() const {
    return {{"scene_digest", scene_digest},
            {"reference_digest", reference_digest},
            {"algorithm", algorithm.settings.name()},
            {"parameters", algorithm.settings.named_text()},
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

Status exists_already(const std::string& path) {
    return invalid_argument(path + " exists; go on with it by --resume or give another name");
}

Result<BenchWriter> BenchWriter::open(const std::string& path, bool resume) {
    for (;;) {
        File file(std::fopen(path.c_str(), resume ? "a" : "ax"));
        if (!file && errno == EEXIST) return exists_already(path);
        if (!file) return cannot_be_written(path, errno);
        struct stat ours {
        }, named{};
        if (::fstat(::fileno(file.get()), &ours) != 0) return cannot_be_written(path, errno);
        if (!S_ISREG(ours.st_mode)) return BenchWriter(path, std::move(file));  // a pipe or a device, which anybody may use
        if (::flock(::fileno(file.get()), LOCK_EX | LOCK_NB) != 0) {
            if (errno == EWOULDBLOCK)
                return failed_precondition(path + ": another bench is writing to it; wait for that one or give another name");
            if (!has_no_locks(errno)) return cannot_be_written(path, errno);
            std::fprintf(stderr, "lightloom: warning: %s cannot be locked there; let no other bench write to it meanwhile\n",
                         path.c_str());
        }
        // Who had it may have replaced it between our opening and our locking it.
        if (::stat(path.c_str(), &named) == 0 && named.st_ino == ours.st_ino && named.st_dev == ours.st_dev)
            return BenchWriter(path, std::move(file));
    }
}

Result<std::string> BenchWriter::text() const {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path_, ignored) ? read_file(path_) : std::string();
}

Status BenchWriter::replace(std::string_view content) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path_, error)) return {};  // nothing was read from it either
    const std::string target = std::filesystem::canonical(path_, error).string();
    if (error) return cannot_be_written(path_, error.value());
    // The new file is locked before it has the name, so that at no time anybody can lock what has it.
    const std::string fresh = target + ".new-" + std::to_string(::getpid());
    Status status = write_file_atomically(fresh, content);
    File file(status.ok() ? std::fopen(fresh.c_str(), "a") : nullptr);
    const auto locked = [&] { return ::flock(::fileno(file.get()), LOCK_EX | LOCK_NB) == 0 || has_no_locks(errno); };
    if (status.ok() && (!file || !locked() || std::rename(fresh.c_str(), target.c_str()) != 0))
        status = cannot_be_written(path_, errno);
    if (!status.ok()) {
        std::filesystem::remove(fresh, error);
        return status;
    }
    file_ = std::move(file);
    return {};
}

Status BenchWriter::append(const Json& line) {
    const std::string text = line.dump() + "\n";
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) == text.size() && std::fflush(file_.get()) == 0) return {};
    return {StatusCode::kResourceExhausted, cannot_be_written(path_, errno).message()};
}

}  // namespace lightloom::client
