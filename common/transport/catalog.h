#pragma once
// The catalog: a row per algorithm with its description, its parameters, the kind of units it needs, how it is made and
// how its tables are learned. A row stands in the algorithm's own file; the command line, the documentation (`lightloom
// algorithms`), validation, plans, workers, coordinator and the property suites all read it from here. An algorithm is
// also named where pbrt's integrators are translated (client/default_algorithm.cpp).

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/by_depth.h"
#include "common/core/result.h"

namespace lightloom {

class AlgorithmSettings;
class Renderer;
struct RendererRequest;
struct LearnRequest;
struct LearningPlan;
class Tables;
struct TablePart;

struct ParameterInfo {
    std::string_view name;
    ByDepth<double> default_value;
    double min_value, max_value;
    bool integer;
    std::string_view help;  ///< What it does, unit, source.
    /// Names of the values 0, 1, ... where a name says more than a number. People are shown names alone; digests, the wire and the
    /// header of an EXR have the number, which is therefore understood as well.
    std::span<const std::string_view> choices = {};
    /// Whether a second number, after a comma, may say what holds behind the camera's first hit; one number holds everywhere.
    bool by_depth = false;

    /// A value in its range as people write it: the name of a choice, or the number, or "5,2".
    std::string text_of(const ByDepth<double>& value) const;
    /// What values there are: "balance, power or maximum", "an integer from 1 to 64", "a number from 0.01 to 1".
    std::string range() const;
};

/// A parameter of other algorithms that this one cannot have, and why: the end of a sentence, for people who ask for it.
struct AbsentParameter {
    std::string_view name, reason;
};

/// What the units of an algorithm cover.
enum class FrameShape : uint8_t {
    kTiles,  ///< Any tile of the frame.
    kWhole,  ///< The whole frame: its pixels share something (photon maps, weights that depend on the unit).
};

/// From which ends an algorithm traces sub-paths of more than one edge, and so which light it can find at all.
enum class Traces : uint8_t {
    kCamera,  ///< Misses caustics of lights that cannot be hit.
    kLight,   ///< Misses what the lens sees through mirrors and smooth glass.
    kBoth,
};

/// How the tables of an algorithm are learned before it renders.
struct LearningInfo {
    /// The parts that its tables have.
    std::span<const TablePart* const> parts;
    /// The training set and the rounds in which it is traced.
    LearningPlan (*plan)(const AlgorithmSettings&);
    /// Makes tables from the data of one round. kCancelled within about a second of a stop request.
    Result<Tables> (*learn)(const LearnRequest&);
    /// Whether these settings need tables at all; null: they always do.
    bool (*wanted)(const AlgorithmSettings&) = nullptr;
};

struct AlgorithmInfo {
    std::string_view name;
    std::string_view summary;  ///< One line.
    std::string_view source;   ///< Paper or book, with equation numbers.
    std::string_view bias;     ///< "unbiased", or what is biased or missing.
    bool merges = false;       ///< Whether its means are off by the bias of merging, which vanishes with merge-radius.
    /// Whether these settings make it merge, and need units of the whole frame for that; null: `merges` and `frame` hold for all.
    bool (*may_merge)(const AlgorithmSettings&) = nullptr;
    std::span<const ParameterInfo> parameters;
    std::span<const AbsentParameter> absent = {};
    Traces traces = Traces::kBoth;
    FrameShape frame = FrameShape::kTiles;
    bool camera_samples = true;  ///< False: all of its light is in splats.
    /// Light paths per pixel and iteration that land anywhere on the frame; null for an algorithm that traces none.
    double (*light_paths_per_pixel)(const AlgorithmSettings&) = nullptr;
    /// Whether light paths belong to a unit and serve all of its samples; otherwise each camera sample has one of its
    /// own.
    bool shares_light_paths = false;
    /// Null for an algorithm without tables. See AlgorithmSettings::learning().
    const LearningInfo* learning = nullptr;
    Result<std::unique_ptr<Renderer>> (*make)(const RendererRequest&);
    /// kInvalidArgument, with what to change, for values that are possible one by one but make no sense together; null: none are.
    Status (*check)(const AlgorithmSettings&) = nullptr;
};

/// The rows, those of add_to_catalog() included, in the order in which users see them.
std::span<const AlgorithmInfo* const> catalog();
/// kNotFound, suggesting a near name and listing the known ones, for an unknown algorithm.
Result<const AlgorithmInfo*> find_algorithm(std::string_view name);
/// Adds a row of the calling program, before it uses the catalog; the row must live as long as the program. Tests use
/// this to show that a new algorithm takes one file and one row.
void add_to_catalog(const AlgorithmInfo& row);

}  // namespace lightloom
