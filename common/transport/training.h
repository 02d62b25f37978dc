#pragma once
// Training units: full paths of the scene for the tables, made by bidirectional algorithms with all of their
// techniques, so that light that is hard to find is in them too. These paths never enter an image, and their random
// numbers differ from those of the job's image.

#include <cstdint>
#include <memory>
#include <stop_token>

#include "common/scene/scene.h"
#include "common/transport/learning.h"
#include "common/transport/renderer.h"

namespace lightloom {

struct MergeTerms;
struct PreparedTables;

/// Samples that one thread traces at a time.
inline constexpr uint64_t kTrainingChunkSamples = 512;

/// Traces training units of one scene: for an algorithm without light sub-paths its own camera samples. For others,
/// without a guide, it pairs camera with light sub-paths, which needs no tables;
/// with the tables of an earlier round as guide its light leaves where that round found it useful, and it makes subspace
/// connections where the algorithm has them, which find far more of the light that is hard to find.
class TrainingGenerator {
  public:
    /// `scene` must outlive the generator. The algorithm must be one that learns.
    static Result<TrainingGenerator> create(const Scene& scene, const RenderSettings& settings, const Tables& guide = {});

    /// Traces the camera samples first_sample .. of a sequence that is spread evenly over the frame, and as many light
    /// sub-paths: each sample has its own (no guide), or all of the unit's are shared in a cache (guided). Of these,
    /// and of more where they are not enough, energy_paths per sample are kept for Q. The result does not depend on the
    /// number of threads. kCancelled after a stop request.
    Result<TrainingData> trace(const TrainingWork& work, std::stop_token stop) const;

  private:
    class Unit;

    explicit TrainingGenerator(const Scene& scene) : scene_(&scene) {}
    Result<TrainingData> trace_unidirectional(const Unit& unit) const;
    Result<TrainingData> trace_pairs(const Unit& unit) const;
    Result<TrainingData> trace_guided(const Unit& unit) const;

    const Scene* scene_;
    std::shared_ptr<const Scene> lit_;  ///< The scene with the guide's emission; null where it has none.
    RouletteRule roulette_;
    /// Of camera sub-paths: off where visits are kept, which tell what a sub-path that goes on finds.
    RouletteRule camera_roulette_;
    LearningPlan plan_;
    Heuristic heuristic_ = Heuristic::kBalance;
    NextEventRays next_event_;
    std::shared_ptr<const MergeTerms> merging_;  ///< Of the first iteration of the render; null if it does not merge.
    bool unidirectional_ = false;                ///< Without light sub-paths.
    uint64_t light_paths_per_iteration_ = 0;     ///< Of the render that the tables are for.
    std::shared_ptr<const PreparedTables> guide_;
    uint64_t seed_ = 0;
    int max_edges_ = 0;
};

/// Learns on this machine alone: traces unit by unit, as workers do for a coordinator, and learns. The tables have the
/// same bytes as the coordinator's. Empty for an algorithm that needs none.
Result<Tables> make_tables(const Scene& scene, const RenderSettings& settings, std::stop_token stop, TrainingReport* report);

/// Renderer::create() for a process on its own: makes the tables first where the algorithm needs them.
Result<std::unique_ptr<Renderer>> create_with_tables(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                     std::stop_token stop, const TechniqueMask* mask = nullptr);

}  // namespace lightloom
