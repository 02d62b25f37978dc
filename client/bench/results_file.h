#pragma once
// The file of a benchmark: one JSON object per line. Checkpoint lines carry an error and its cost; the last line of a run has
// "done": true and says when the threshold was reached. Every line names everything that decides its run, so that lines can
// be filtered and joined without the command that made them.

#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "client/bench/error_curve.h"
#include "client/progressive_render.h"
#include "common/metrics/metrics.h"

namespace lightloom::client {

using Json = nlohmann::ordered_json;

/// Everything that decides a run except the machine and its mood.
struct BenchRun {
    std::string scene_digest, reference_digest;
    AlgorithmChoice algorithm;
    int width = 0, height = 0, max_depth = 0;
    uint64_t seed = 0;
    uint32_t threads = 1;
    double time_limit = 0;         ///< Seconds, preparation included; 0: none.
    uint64_t iteration_limit = 0;  ///< 0: none.
    double threshold = 12;         ///< MAPE in percent.
    double stop_after = -1;        ///< Seconds after which a run ends once it has reached the threshold; negative: never.
    std::string build;

    Json json() const;
    /// 16 hexadecimal digits of the digest of json().
    std::string key() const;
};

/// The line of a checkpoint. `run_line` is BenchRun::json() with what else all lines of the file carry.
Json checkpoint_line(Json run_line, const ProgressiveRender& render, const Metrics& metrics);
/// The last line of a run that ended as `end` (its last checkpoint line) says.
Json done_line(Json end, std::span<const CurvePoint> curve, double threshold);

/// What a file holds already.
struct BenchHistory {
    std::map<std::string, Json> done;  ///< Last line of each finished run, by key.
    std::string kept;                  ///< All lines but those of unfinished runs and a torn end.
};

/// Reads the lines of an earlier, perhaps killed process. Checkpoints of the runs in `keys` that have no last line are left
/// out, because those runs start again. The beginning of such a line at the end of the file is ignored; any other line that
/// is not JSON is an error that names it.
Result<BenchHistory> parse_history(std::string_view text, const std::string& file_name, const std::set<std::string>& keys);

/// The error of a benchmark that would begin a file which is there.
Status exists_already(const std::string& path);

/// The file of a benchmark. No other process can open it as such meanwhile, unless its file system has no locks, of which open()
/// warns; each line is whole before the next begins.
class BenchWriter {
  public:
    /// Makes the file; one that exists is refused unless `resume` is set, and always while another process has it open.
    static Result<BenchWriter> open(const std::string& path, bool resume);
    /// What it holds, for parse_history().
    Result<std::string> text() const;
    /// Replaces what it holds; after an error that is still there.
    Status replace(std::string_view content);
    Status append(const Json& line);

  private:
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    using File = std::unique_ptr<std::FILE, Close>;
    BenchWriter(std::string path, File file) : path_(std::move(path)), file_(std::move(file)) {}
    std::string path_;
    File file_;  ///< Locked where that is possible.
};

/// One row per algorithm, in the order of `algorithms`: medians over the seeds, and ratios to the first row.
std::string bench_table(const std::vector<std::string>& algorithms, const std::vector<Json>& done, double threshold);

}  // namespace lightloom::client
