#pragma once
// What a benchmark prints when it has ended.

#include <span>
#include <string>
#include <vector>

#include "client/bench/suite.h"

namespace lightloom::client {

/// One row per scene, algorithm and budget, from the lines of type "run": relMSE at the end (median, standard error of the mean
/// over the seeds), samples and seconds.
std::string suite_table(std::span<const Json> lines);

/// One row per algorithm, in the order of `algorithms`: where the MAPE fell to the threshold, medians over the seeds, and ratios to
/// the first row. `done`: lines of type "run".
std::string threshold_table(const std::vector<std::string>& algorithms, const std::vector<Json>& done, double threshold);

/// What became of an expectation.
struct Outcome {
    enum class Kind { kHolds, kFails, kNotJudged };
    Kind kind = Kind::kNotJudged;
    std::string scene, text;  ///< What was expected,
    std::string found;        ///< and what was found.
};
/// Of all scenes, by the lines of finished runs; of several budgets the last one counts. An error is kInvalidArgument of lines that
/// are not whole.
Result<std::vector<Outcome>> judge_expectations(const Suite& suite, std::span<const Json> lines);

}  // namespace lightloom::client
