#pragma once
// A suite: scenes x algorithms x seeds x budgets that are measured together, and what is expected of the numbers. Its file is JSON,
// described in client/README.md; the command line for one scene makes one, too.

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/job_options.h"
#include "client/progressive_render.h"

namespace lightloom::client {

using Json = nlohmann::ordered_json;

/// What a run may take. At least one of the two is set; with both, the one that is reached first counts.
struct RunBudget {
    double seconds = 0;    ///< Preparation included.
    uint64_t samples = 0;  ///< Per pixel: iterations.

    Json json() const;
    /// "20 s" or "64 spp".
    std::string text() const;
    friend bool operator==(const RunBudget&, const RunBudget&) = default;
};

/// How a reference is made where none is found.
struct ReferenceRecipe {
    AlgorithmChoice algorithm;
    RunBudget budget;
    uint64_t seed = 777;
};

/// What a suite expects of its numbers: that is how a claim is tested, and it should hold by a wide margin.
struct Expectation {
    enum class Kind {
        kErrorRatio,  ///< Median relMSE of `algorithm` over that of `other` lies within [low, high].
        kError,       ///< Median relMSE of `algorithm`.
        kMeanRatio,   ///< Mean over the seeds of the image's mean over the reference's.
        kVerdict,     ///< The judge of stability says (or, `negated`, does not say) `word`.
    };
    Kind kind = Kind::kError;
    std::string algorithm, other, word;
    double low = 0, high = 0;
    bool negated = false;
    std::string text() const;
};

struct SuiteScene {
    std::string name;   ///< Unique in the suite.
    std::string claim;  ///< What the scene tests, in plain words.
    JobOptions job;     ///< File, root, parts left out, resolution, depth, first seed.
    bool optional = false;
    std::string reference;  ///< File; empty: looked up beside the scene, or made.
    std::optional<ReferenceRecipe> recipe;
    std::vector<AlgorithmChoice> algorithms;
    std::vector<RunBudget> budgets;
    uint32_t seeds = 3;
    std::vector<Expectation> expectations;
};

struct Suite {
    std::string name;            ///< Empty for the command line's one scene.
    std::string description;     ///< In plain words.
    std::string digest;          ///< SHA-256 of the file.
    bool shared_tables = false;  ///< Seeds of an algorithm share tables, made once; otherwise each run learns its own.
    double threshold = 0;        ///< MAPE in percent at which time is taken; 0: none.
    double stop_after = -1;      ///< Seconds after which a run ends once it has reached the threshold; negative: never.
    bool stability = false;
    uint32_t share_iterations = 0;  ///< To measure the shares of techniques with; 0: they are not measured.
    std::vector<SuiteScene> scenes;
};

/// Seeds that a judgement of stability has at least.
inline constexpr uint32_t kStabilitySeeds = 20;

/// Reads a suite file. `stability`: with the seeds and the budget of its "stability", for every scene. Files in it are relative to
/// its directory. kInvalidArgument with "FILE: where: what" for anything that is not understood.
Result<Suite> parse_suite(const std::string& text, const std::string& file_name, bool stability);
Result<Suite> read_suite(const std::string& path, bool stability);

}  // namespace lightloom::client
