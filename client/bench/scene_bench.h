#pragma once
// A scene of a suite, ready to be measured: read and built, with its reference, and with the tables that its runs share.

#include <map>
#include <memory>
#include <stop_token>
#include <string>

#include "client/bench/reference_image.h"
#include "client/bench/run_lines.h"
#include "client/bench/suite.h"
#include "client/local_scene.h"
#include "client/table_options.h"
#include "common/work/service.h"

namespace lightloom::client {

/// What the command line says about all scenes.
struct SuiteOptions {
    std::string out;             ///< Results file.
    std::string references;      ///< Directory of references that were made; empty: RESULTS.references.
    std::string server;          ///< HOST:PORT; empty: this machine.
    JobPort* service = nullptr;  ///< Its interface; set if `server` is.
    bool resume = false, quiet = false;
    bool images = true;  ///< Keep the image of each algorithm's first seed.
    uint32_t threads = 1;
    double slice = 2;   ///< Seconds of a run before the next one's turn.
    double budget = 0;  ///< Seconds for the whole suite; 0: no limit.
    TableCacheOptions cache;

    /// The results file's name without .jsonl, and `ending`.
    std::string beside_results(const char* ending) const;
};

class SceneBench {
  public:
    /// What is known before a reference is made.
    struct ReferenceBudget {
        double seconds = 0;  ///< That it may take; infinite without a budget.
        bool begun = false;  ///< Runs of the scene were measured already.
    };
    /// Reads and builds the scene and finds its reference, or makes it. Warnings go to standard error.
    static Result<std::unique_ptr<SceneBench>> open(const SuiteScene& scene, const Suite& suite, const SuiteOptions& options,
                                                    const ReferenceBudget& budget, std::stop_token stop);

    /// All that identifies a run.
    BenchRun run_of(const AlgorithmChoice& algorithm, uint64_t seed, const RunBudget& budget) const;
    /// Begins to render it: here, with tables that are made, shared or cached, or as a job of the service.
    Result<std::unique_ptr<MeasuredRender>> start(const BenchRun& run, std::stop_token stop);
    /// The line of type "techniques" of an algorithm; kInvalidArgument where it shows no contributions.
    Result<Json> shares(const AlgorithmChoice& algorithm, std::stop_token stop);

    const SuiteScene& scene() const { return scene_; }
    const Reference& reference() const { return *reference_; }
    /// Where a reference was made, what --budget cut of it; empty otherwise.
    const std::string& cut_of_reference() const { return cut_of_reference_; }
    /// A reference that a budget had cut was made anew: what was measured by it is measured again.
    bool reference_was_remade() const { return reference_was_remade_; }

  private:
    SceneBench(const SuiteScene& scene, const Suite& suite, const SuiteOptions& options)
        : scene_(scene),
          suite_(suite),
          options_(options) {}
    Status find_or_make_reference(const ReferenceBudget& budget, std::stop_token stop);
    /// At PATH.exr, or at PATH-cut.exr where the budget ended it; returns which.
    Result<std::string> make_missing_reference(const std::string& path, double seconds, std::stop_token stop);
    JobSpec spec_of(const BenchRun& run) const;
    Result<Preparation> preparation_of(const BenchRun& run, std::stop_token stop);
    std::string tables_word(const AlgorithmChoice& algorithm) const;

    const SuiteScene& scene_;
    const Suite& suite_;
    const SuiteOptions& options_;
    BuiltJob built_;
    std::optional<Reference> reference_;
    std::string cut_of_reference_;
    bool reference_was_remade_ = false;
    std::map<std::string, Preparation> first_;  ///< Of the first seed, by label: of all seeds where they share.
    std::map<std::string, RareLight> rare_;     ///< By label.
};

}  // namespace lightloom::client
