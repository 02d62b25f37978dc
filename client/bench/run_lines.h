#pragma once
// The lines of a results file, one function each. Every line names everything that decides it, so that lines can be filtered and
// joined without the command that made them. client/README.md describes the fields.

#include <optional>
#include <span>
#include <string>

#include "client/bench/error_curve.h"
#include "client/bench/measured_render.h"
#include "client/bench/reference_image.h"
#include "client/bench/results_file.h"
#include "client/bench/suite.h"
#include "common/film/rare_light.h"
#include "common/metrics/metrics.h"

namespace lightloom::client {

/// Everything that decides a run except the machine and its mood.
struct BenchRun {
    std::string scene;  ///< Name in the suite.
    std::string scene_digest, reference_digest;
    AlgorithmChoice algorithm;
    int width = 0, height = 0, max_depth = 0;
    uint64_t seed = 0;
    uint32_t threads = 1;
    RunBudget budget;
    double threshold = 0;    ///< MAPE in percent at which time is taken; 0: none.
    double stop_after = -1;  ///< Seconds after which a run ends once it has reached the threshold; negative: never.
    std::string tables;      ///< Of learning algorithms: "made" by the run, "shared" by its seeds, "cached" if they may be found.
    std::string server;      ///< HOST:PORT where it is rendered; empty: here.
    std::string build;

    Json json() const;
    /// 16 hexadecimal digits of the digest of json().
    std::string key() const;
    /// What every line of the run begins with.
    Json line(const char* type) const;
};

struct StartLine {
    double suite_seconds = 0;   ///< What earlier processes spent.
    double budget_seconds = 0;  ///< 0: none.
    uint32_t threads = 1;
    std::string server, build;
};
Json start_line(const Suite& suite, const StartLine& start);

Json scene_line(const SuiteScene& scene, const BenchRun& any_run, const Reference& reference, const std::string& reference_image);

/// `suite_seconds`: since the suite began, over all of its processes.
Json checkpoint_line(const BenchRun& run, const MeasuredRender& render, const Metrics& metrics, const Reference& reference,
                     double suite_seconds);

/// Adds where the curve falls to the threshold: "capped" and "reached" or "extrapolated".
void add_crossing(Json& line, std::span<const CurvePoint> curve, double threshold);

/// What only the last line of a run says.
struct RunEnd {
    const RgbImage& image;
    const RgbImage& reference;
    std::span<const CurvePoint> curve;
    std::string image_file;                     ///< Empty: not kept.
    std::optional<double> given_seconds;        ///< The suite's budget cut the run to so many.
    std::optional<RareLightReport> rare_light;  ///< Where light is there that only chance hits find.
};
/// `checkpoint`: the run's last one.
Json run_line(Json checkpoint, const BenchRun& run, const RunEnd& end);

Json cut_line(const std::string& scene, const std::string& what);

}  // namespace lightloom::client
