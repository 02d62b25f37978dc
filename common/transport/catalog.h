#pragma once
// The catalog: every algorithm with what it is, its parameters, what kind of units it needs, how it is made and how its tables are
// learned. One row per algorithm, written in the algorithm's own file; the command line, the documentation (`lightloom
// algorithms`), validation, plans, workers, coordinator and the property suites all read it from here. Besides, an algorithm is
// named where pbrt's integrators are translated (client/default_algorithm.cpp).

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

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
    double default_value;
    double min_value, max_value;
    bool integer;
    std::string_view help;  ///< What it does, unit, source.
    /// Names of the values 0, 1, ... where a name says more than a number; both are understood.
    std::span<const std::string_view> choices = {};
};

/// What the units of an algorithm cover.
enum class FrameShape : uint8_t {
    kTiles,  ///< Any tile of the frame.
    kWhole,  ///< The whole frame: something of the unit belongs to all of its pixels (photon maps, weights of the unit's own).
};

/// From which ends an algorithm traces sub-paths of more than one edge, and so which light it can find at all.
enum class Traces : uint8_t {
    kCamera,  ///< Misses caustics of lights that cannot be hit.
    kLight,   ///< Misses what the lens sees through mirrors and smooth glass.
    kBoth,
};

/// How the tables of an algorithm are learned before it renders.
struct LearningInfo {
    /// What its tables consist of.
    std::span<const TablePart* const> parts;
    /// The training set and the rounds in which it is traced.
    LearningPlan (*plan)(const AlgorithmSettings&);
    /// Tables from the data of one round. kCancelled within about a second of a stop request.
    Result<Tables> (*learn)(const LearnRequest&);
};

struct AlgorithmInfo {
    std::string_view name;
    std::string_view summary;  ///< One line.
    std::string_view source;   ///< Paper or book, with equation numbers.
    std::string_view bias;     ///< "unbiased", or what is biased or missing.
    std::span<const ParameterInfo> parameters;
    Traces traces = Traces::kBoth;
    FrameShape frame = FrameShape::kTiles;
    bool camera_samples = true;  ///< False: all of its light is in splats.
    /// Light paths per pixel and iteration that land anywhere on the frame; null for an algorithm that traces none.
    double (*light_paths_per_pixel)(const AlgorithmSettings&) = nullptr;
    /// Light paths belong to a unit and serve all of its samples, instead of one to each camera sample.
    bool shares_light_paths = false;
    /// Null for an algorithm without tables.
    const LearningInfo* learning = nullptr;
    Result<std::unique_ptr<Renderer>> (*make)(const RendererRequest&);
};

/// The rows, those of add_to_catalog() included, in the order in which they are listed for people.
std::span<const AlgorithmInfo* const> catalog();
/// kNotFound, listing the known names, for an unknown algorithm.
Result<const AlgorithmInfo*> find_algorithm(std::string_view name);
/// A row that a program brings itself, before it uses the catalog; the row must outlive the program. Tests show with it that an
/// algorithm is one file and one row.
void add_to_catalog(const AlgorithmInfo& row);

}  // namespace lightloom
