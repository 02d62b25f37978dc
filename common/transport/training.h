#pragma once
// Training units: full paths of the scene for the tables, made by bidirectional algorithms with all of their techniques, so that
// light that is hard to find is in them too. They never enter an image, and their random numbers are not those of the same job's.

#include <cstdint>
#include <stop_token>

#include "common/scene/scene.h"
#include "common/tables/train.h"
#include "common/transport/parameters.h"
#include "common/transport/renderer.h"

namespace lightloom {

struct PreparedTables;

/// What one thread traces at a time.
inline constexpr uint64_t kTrainingChunkSamples = 512;

/// Which part of the dataset a unit traces.
struct TrainingWork {
    uint64_t first_sample = 0;
    uint64_t sample_count = 0;
    uint64_t total_samples = 0;  ///< Of the whole dataset: sets the size of the blocks.
};

/// Traces training units of one scene. Two rounds: a pilot by classic pairing, which needs nothing; then, guided by the pilot's
/// tables, subspace connections, which find far more of the light that is hard to find. The tables that render are trained on the
/// second round alone: its paths have the smaller variance, and the pilot's few would outvote them.
class TrainingGenerator {
  public:
    /// `scene` must outlive the generator. Without `guide`: a pilot.
    static Result<TrainingGenerator> create(const Scene& scene, const RenderSettings& settings,
                                            const SubspaceTables* guide = nullptr);

    /// Camera samples first_sample .. of a sequence that is spread evenly over the frame, and as many light sub-paths: each
    /// sample its own (pilot), or all of the unit's shared in a cache (guided). Of these, and of more where they are not enough,
    /// energy_paths per sample are kept for Q. The result does not depend on the number of
    /// threads. kCancelled after a stop request.
    Result<TrainingData> trace(const TrainingWork& work, std::stop_token stop) const;

  private:
    class Unit;

    explicit TrainingGenerator(const Scene& scene) : scene_(&scene) {}
    Result<TrainingData> trace_pairs(const Unit& unit) const;
    Result<TrainingData> trace_guided(const Unit& unit) const;

    const Scene* scene_;
    TransportParameters parameters_;
    std::shared_ptr<const PreparedTables> guide_;
    uint64_t seed_ = 0;
    int max_depth_ = 0;
};

/// A pilot's unit.
Result<TrainingData> trace_training(const Scene& scene, const RenderSettings& settings, const TrainingWork& work,
                                    std::stop_token stop);

/// Training on this machine alone: traces unit by unit, as a coordinator has it done by workers, and trains. The tables
/// have the same bytes as that coordinator's.
Result<SubspaceTables> make_tables(const Scene& scene, const RenderSettings& settings, std::stop_token stop,
                                   TrainingReport* report);

/// Renderer::create() for a process on its own: makes the tables first where the algorithm needs them.
Result<std::unique_ptr<Renderer>> create_with_tables(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                     std::stop_token stop);

}  // namespace lightloom
