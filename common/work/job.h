#pragma once
// JobSpec: what a user asks for, immutable once submitted. WorkUnit: the smallest self-contained piece of it. Plan: a
// pure function from frame, algorithm and number of iterations to units. None of these depends on workers, clocks or
// networks.

#include <cstdint>
#include <string>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/film/frame.h"
#include "common/transport/learning.h"
#include "common/transport/settings.h"
#include "common/transport/unit.h"

namespace lightloom {

struct SceneOptions;

/// A new field must be entered in common/work/job_fields.h, which says what it decides; it does not compile otherwise.
struct JobSpec {
    static constexpr uint32_t kMaxSamplesPerPixel = 1u << 24;
    /// Bounds of `noise_target`. A black image has a relMSE below 1, so that a larger target says nothing.
    static constexpr double kMinNoiseTarget = 1e-9, kMaxNoiseTarget = 1;

    AlgorithmSettings algorithm;  ///< As chosen by the user; with every default written down once the job is accepted.
    uint64_t seed = 0;
    uint32_t samples_per_pixel = 0;  ///< Iterations; 0 when time-limited.
    double time_limit_seconds = 0;   ///< 0 when there is none. At most one of the two is set.
    /// Estimated relMSE (NoiseEstimate) at which the job ends; with another bound, whichever comes first. 0: none, and then one of
    /// the two others is set.
    double noise_target = 0;
    int32_t max_depth = -1;         ///< Bounces; -1: the scene's.
    int32_t width = 0, height = 0;  ///< 0: the scene's.
    Rect crop;                      ///< Window of the frame, in its pixels; all zeros: the scene's.
    Digest scene_root;              ///< Digest of the scene's file list (asset manifest).
    FrameLayout frame;              ///< Filled from the scene when the job is accepted.
    bool first_hit_layers = false;  ///< Also write albedo, normal and depth of the first hit.

    /// Digest of everything that decides the bytes of the image except how many iterations are rendered.
    Digest spec_digest() const;
    friend bool operator==(const JobSpec&, const JobSpec&) = default;
};

/// True if the two agree in everything that the submitter gives; fields that the coordinator fills in do not count.
bool same_request(const JobSpec& a, const JobSpec& b);

/// What light transport needs of a spec.
inline RenderSettings render_settings(const JobSpec& spec) {
    return {.algorithm = spec.algorithm, .seed = spec.seed, .max_depth = spec.max_depth};
}

/// What the scene of a job is built with.
SceneOptions scene_options(const JobSpec& spec);

enum class UnitKind : uint8_t {
    kRender,    ///< A partial of the image.
    kTraining,  ///< Paths that the job's tables are learned from; never part of an image.
    kProbe,     ///< Paths of the same kind, traced only to measure how many a time-limited job can afford.
};

/// Identity of a unit inside a job. Units of one group complete one another: their techniques' weights sum to one only
/// over the whole group, so only complete groups enter an image.
struct UnitKey {
    uint32_t group = 0;
    uint32_t tile = 0;
    UnitKind kind = UnitKind::kRender;
    uint32_t round = 0;  ///< kTraining: index into the rounds of the algorithm's LearningPlan.
    friend auto operator<=>(const UnitKey&, const UnitKey&) = default;
};

struct WorkUnit {
    UnitKey key;
    RenderUnit render = {};      ///< For kRender; the light paths are a share in proportion to the tile.
    TrainingWork training = {};  ///< For the other kinds.
};

/// One full-frame group of iterations.
struct Group {
    uint32_t index = 0;
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;
};

/// What the plan of an image depends on besides the frame.
struct PlanOptions {
    uint64_t light_paths_per_iteration = 0;  ///< N1 |crop|; 0 for algorithms that splat nothing.
    bool whole_frame = false;                ///< Units cover the whole frame instead of tiles.
    bool splats_only = false;                ///< Units have no camera samples.
    bool shares_light_paths = false;         ///< See AlgorithmInfo; such samples take longer.
};
/// The options that follow from the algorithm's row of the catalog.
PlanOptions plan_options(const FrameLayout& frame, const AlgorithmSettings& algorithm);

/// The units of a group: one per tile, in order. The group's light paths are shared out in proportion to the tiles'
/// areas with exact cumulative rounding.
std::vector<WorkUnit> split_group(const Group& group, const std::vector<Rect>& tiles, const PlanOptions& options);

/// The plan is a pure function of frame, options and the number of iterations. Group sizes grow geometrically: a group
/// is at most 5 % of all iterations before it, so that a job stopped at any group boundary wastes little, and rendering it again
/// with that number of iterations makes the very same groups. It has one iteration at least. At most it has what makes about 2^22
/// camera samples per unit (2^21 where samples share light sub-paths), but no more than 32 iterations, unless they make
/// fewer than 2^18 samples; 8 of a whole frame are always allowed.
class Plan {
  public:
    Plan(const FrameLayout& frame, const PlanOptions& options);
    Plan(const FrameLayout& frame, const AlgorithmSettings& algorithm) : Plan(frame, plan_options(frame, algorithm)) {}
    /// The plan of a part of a training set, `work`: group i is one unit, of the samples from i * kTrainingUnitSamples
    /// on, and iterations stand for samples.
    static Plan training(UnitKind kind, uint32_t round, const TrainingWork& work);

    /// Group `index` of an unbounded job.
    Group group(uint32_t index) const;
    /// Upper bound of a group's iterations.
    uint32_t max_group_iterations() const { return max_group_iterations_; }
    /// The groups that make exactly `iterations` iterations; the last one is cut short where need be.
    std::vector<Group> groups_for(uint64_t iterations) const;
    /// The number of these groups, without making them.
    uint32_t group_count(uint64_t iterations) const;
    /// The units of a group, tile by tile.
    std::vector<WorkUnit> units(const Group& group) const;
    uint32_t tile_count() const { return uint32_t(tiles_.size()); }
    /// The key of a unit of this plan.
    UnitKey key(uint32_t group, uint32_t tile) const { return {group, tile, kind_, round_}; }

  private:
    Plan() = default;

    PlanOptions options_;
    std::vector<Rect> tiles_;
    uint32_t max_group_iterations_ = 1;
    UnitKind kind_ = UnitKind::kRender;
    uint32_t round_ = 0;
    TrainingWork training_;
};

}  // namespace lightloom
