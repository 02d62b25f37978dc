#pragma once
// Results of `lightloom bench`, read for a report: JSON lines of the format "lightloom-bench 2" (tests/bench/README.md).

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"

namespace lightloom::client::report {

using Json = nlohmann::ordered_json;

/// A process that worked on a file.
struct Start {
    std::string suite, suite_digest, utc, build, server;
    std::string processor, system;
    double logical_processors = 0, memory_bytes = 0;  ///< 0: not known.
    double threads = 0;
    bool stability = false;
    std::optional<double> budget_seconds;
};

/// What a run may spend: seconds, samples per pixel, or both, whichever ends first; 0: no bound.
struct Budget {
    double seconds = 0, samples = 0;

    bool operator==(const Budget&) const = default;
    std::string text() const;  ///< "20 s", "64 samples per pixel", "20 s or 64 samples per pixel"
};

struct SceneInfo {
    std::string name, file, digest, claim;
    int width = 0, height = 0, max_depth = 0;
    std::string reference, reference_digest, reference_algorithm;
    std::optional<double> reference_samples;
    std::optional<double> floor;  ///< relMSE that the reference's own noise adds to every error.
    std::string reference_image;  ///< Path that can be opened; empty if there is none.
};

struct Checkpoint {
    double iterations = 0, seconds = 0, preparation = 0;
    double mape_percent = 0, relmse = 0;
    std::optional<double> relmse_own;  ///< Without the reference's noise.
    std::optional<double> estimated;   ///< relMSE as the run itself estimates it.
    bool near_floor = false;
};

/// A run that came to its end.
struct Run {
    std::string id, scene, label;
    Budget budget;  ///< As the suite asks for it.
    uint64_t seed = 0;
    std::vector<Checkpoint> curve;        ///< Ascending in iterations; the last one is the end of the run.
    std::optional<double> threshold;      ///< MAPE in percent that the run asks for.
    bool capped = false;                  ///< It ended above the threshold.
    std::optional<double> given_seconds;  ///< Time that a cut left it.
    bool cached_tables = false;
    double dropped_samples = 0;
    std::optional<double> fireflies, rare_share;
    std::string image;  ///< Path that can be opened; empty if there is none.

    const Checkpoint& end() const { return curve.back(); }
};

struct TechniqueClass {
    std::string name;
    double light = 0;             ///< Share of the image's light.
    std::optional<double> noise;  ///< Share of its variance.
};

struct Techniques {
    std::string scene, label;
    std::vector<TechniqueClass> classes;
};

/// Something that a budget for the whole suite took away, in words.
struct Cut {
    std::string scene, what;
};

struct Results {
    std::vector<Start> starts;
    std::vector<SceneInfo> scenes;  ///< In the order of their first appearance.
    std::vector<Run> runs;
    std::vector<Techniques> techniques;
    std::vector<Cut> cuts;
    std::vector<std::string> notes;  ///< What was left out, and why.
    std::vector<Json> lines;         ///< All of them, for other readers.

    const SceneInfo* scene(std::string_view name) const;
};

/// Adds the lines of one file. Runs without a last line are left out with a note, and so is the beginning of a line at the end of
/// the file, which a killed process leaves behind. kInvalidArgument, "NAME:LINE: ...", for anything else that does not have the
/// format. Pictures are looked for in NAME with ".images" in place of ".jsonl".
Status add_results(std::string_view text, const std::string& name, Results* results);
/// Reads files and merges them. Scenes of one name must be the same scene with the same reference.
Result<Results> read_results(std::span<const std::string> paths);

}  // namespace lightloom::client::report
