#pragma once
// JobSpec: what a user asks for, immutable once submitted. WorkUnit: the smallest self-contained piece of it. plan(): the
// pure function between them. Nothing here knows about workers, clocks or networks.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/film/frame.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"

namespace lightloom {

/// A new field must be entered in common/work/job_fields.h, which says what it decides; it does not compile otherwise.
struct JobSpec {
    static constexpr uint32_t kMaxSamplesPerPixel = 1u << 24;

    std::string algorithm = "path";
    std::map<std::string, std::string> parameters;  ///< --set key=value, canonical text; validated by the catalog.
    uint64_t seed = 0;
    uint32_t samples_per_pixel = 0;  ///< Iterations; 0 when time-limited.
    double time_limit_seconds = 0;   ///< 0 when bounded by samples. Exactly one of the two is set.
    int32_t max_depth = -1;          ///< Bounces; -1: the scene's.
    int32_t width = 0, height = 0;   ///< 0: the scene's.
    Digest scene_root;               ///< Of the scene's file list (asset manifest).
    FrameLayout frame;               ///< Filled from the scene when the job is accepted.
    bool first_hit_layers = false;   ///< Also write albedo, normal and depth of the first hit.

    /// Digest of everything that decides the bytes of the image except how many iterations are rendered.
    Digest spec_digest() const;
    friend bool operator==(const JobSpec&, const JobSpec&) = default;
};

/// True unless they differ in what those who submit give; what the coordinator fills in does not count.
bool same_request(const JobSpec& a, const JobSpec& b);

/// What light transport needs of a spec.
inline RenderSettings render_settings(const JobSpec& spec) {
    return {.algorithm = spec.algorithm, .parameters = spec.parameters, .seed = spec.seed, .max_depth = spec.max_depth};
}

enum class UnitKind : uint8_t {
    kRender,    ///< A partial of the image.
    kTraining,  ///< Paths that the job's tables are learned from; never part of an image.
    kProbe,     ///< The same, only to measure how many of them a time-limited job can afford.
    kPilot,     ///< The same, for the first tables, which guide the tracing of kTraining; see TrainingGenerator.
};

/// Identity of a unit inside a job. Units of one group complete one another: their techniques' weights sum to one only
/// over the whole group, so only complete groups enter an image.
struct UnitKey {
    uint32_t group = 0;
    uint32_t tile = 0;
    UnitKind kind = UnitKind::kRender;
    friend auto operator<=>(const UnitKey&, const UnitKey&) = default;
};

struct WorkUnit {
    UnitKey key;
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;  ///< Camera samples per pixel of the tile.
    Rect tile;
    /// Light paths that this unit traces and splats: a share of N1 * iterations * pixels proportional to the tile, fixed by
    /// the plan. `first_light_path` numbers them within the group.
    uint64_t first_light_path = 0;
    uint64_t light_path_count = 0;
    TrainingWork training = {};  ///< All kinds but kRender.
};

/// One full-frame group of iterations.
struct Group {
    uint32_t index = 0;
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;
};

/// What light transport needs of a unit.
inline UnitWork unit_work(const WorkUnit& unit) {
    return {.first_iteration = unit.first_iteration,
            .iteration_count = unit.iteration_count,
            .group_first_iteration = unit.first_iteration,
            .tile = unit.tile,
            .first_light_path = unit.first_light_path,
            .light_path_count = unit.light_path_count};
}

/// The units of a group: one per tile, in order. Light paths: the group's total, round(light_paths_per_pixel * iterations *
/// pixels), is shared out in proportion to the tiles' areas with exact cumulative rounding.
std::vector<WorkUnit> split_group(const Group& group, const std::vector<Rect>& tiles, double light_paths_per_pixel);

/// The plan is a pure function of frame, N1 and the number of iterations. Group sizes grow geometrically: a group is at
/// most 5 % of all iterations before it (at least one iteration, at most what makes about 2^18 camera samples), so that a
/// job stopped at any group boundary wastes little, and rendering it again with that number of iterations makes the very
/// same groups.
class Plan {
  public:
    /// `light_paths_per_pixel` is N1, in light paths per pixel and iteration (0 for algorithms that splat nothing).
    /// `whole_frame` forbids tiles (stratified pairing, photon maps).
    Plan(const FrameLayout& frame, double light_paths_per_pixel, bool whole_frame = false);
    /// The plan of a part of a training set, `work`: group i is the unit of its samples i * kTrainingUnitSamples onwards, its
    /// iterations are samples.
    static Plan training(UnitKind kind, const TrainingWork& work);

    /// Group `index` of an unbounded job.
    Group group(uint32_t index) const;
    /// Upper bound of a group's iterations.
    uint32_t max_group_iterations() const { return max_group_iterations_; }
    /// The groups that make exactly `iterations` iterations; the last one is cut short where need be.
    std::vector<Group> groups_for(uint64_t iterations) const;
    /// How many groups these are, without making them.
    uint32_t group_count(uint64_t iterations) const;
    /// The units of a group, tile by tile.
    std::vector<WorkUnit> units(const Group& group) const;
    uint32_t tile_count() const { return uint32_t(tiles_.size()); }

  private:
    Plan() = default;

    double light_paths_per_pixel_ = 0;
    std::vector<Rect> tiles_;
    uint32_t max_group_iterations_ = 1;
    UnitKind kind_ = UnitKind::kRender;
    TrainingWork training_;
};

}  // namespace lightloom
