#pragma once
// What a suite has measured: the lines of its results file, what they hold already, and how new ones take the place of old ones.
// Nothing is taken out of the file before what replaces it is in it.

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/bench/results_file.h"
#include "client/bench/run_lines.h"

namespace lightloom::client {

class ResultsBook {
  public:
    /// Opens the file. A run that an earlier budget cut counts as done only with `cut_is_done`. kFailedPrecondition where the file
    /// holds another suite's results. Notes on standard error unless `quiet`.
    static Result<ResultsBook> open(const std::string& path, bool resume, const std::string& suite, bool cut_is_done, bool quiet);

    double suite_seconds() const { return history_.suite_seconds; }  ///< Of earlier processes.
    bool has_shares(const std::string& scene, const std::string& label) const;
    bool has_runs_of(const std::string& scene) const { return scenes_.contains(scene); }
    /// Whether a run of this name is done, whatever else decides it.
    bool is_done(const std::string& scene, const std::string& label, uint64_t seed, const RunBudget& budget) const;
    /// The same of the run itself. kFailedPrecondition where the file holds one of the same name that something else decided; with
    /// `other_reference`, one that was measured by another reference is not done instead.
    Result<bool> is_done(const BenchRun& run, bool other_reference);

    /// Holds a line back until something follows it, so that a file without work to do stays as it is.
    void announce(Json line) { announced_.push_back(std::move(line)); }
    /// Forgets the lines of a scene that were held back.
    void drop_announced() { announced_.clear(); }
    /// The line of this process, before anything else.
    void set_start(Json line) { start_ = std::move(line); }
    Status append(const Json& line);
    /// Appends the last line of a run, which takes the place of an older one of the same name.
    Status finish(const BenchRun& run, const Json& line);
    /// Takes the lines of type "cut" of a scene out, which was measured in full.
    Status forget_cuts(const std::string& scene);

    /// All lines but those of runs that nobody has asked for by is_done().
    std::vector<Json> lines() const;

  private:
    ResultsBook(std::string path, BenchWriter writer, BenchHistory history, bool cut_is_done);
    Status rewrite();

    std::string path_;
    BenchWriter writer_;
    BenchHistory history_;
    bool cut_is_done_;
    std::vector<Json> lines_;
    std::optional<Json> start_;
    std::vector<Json> announced_;
    std::set<std::string> scenes_, done_names_;       ///< Of the runs that the file held at first.
    std::map<std::string, std::string> key_by_name_;  ///< All of those, the cut ones too.
    std::set<std::string> keys_;                      ///< That were asked for.
};

}  // namespace lightloom::client
