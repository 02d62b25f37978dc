#pragma once
// From the lines of a results file to a judgement of every algorithm on every scene.

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/metrics/stability.h"

namespace lightloom::client {

using Json = nlohmann::ordered_json;

/// All finished runs of one algorithm on one scene with one budget, which differ in their seeds.
struct Judged {
    std::string scene, label;
    Json budget;  ///< {"seconds": 20} or {"samples": 64}.
    Stability stability;
    int cut = 0;       ///< Runs that --budget cut,
    int left_out = 0;  ///< and those of them that are not judged: much_shorter() than the longest.
};

/// One for each (scene, label, budget) with at least one finished run, in the order in which their first runs ended. Of several
/// lines of a scene or of a run, the last one holds. Lines of other types and checkpoints of unfinished runs are passed over.
/// kInvalidArgument names the line, counted from 1, and the field that is missing or of another type.
Result<std::vector<Judged>> judge_results(std::span<const Json> lines);

/// A table for a terminal, a row each; the last column is the verdict.
std::string verdict_table(std::span<const Judged> judged);

/// An array of objects with all that Stability has. Numbers that are not finite or not known are absent.
Json verdict_json(std::span<const Judged> judged);

}  // namespace lightloom::client
