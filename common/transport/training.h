#pragma once
// Training units: full paths of the scene for the tables, made by bidirectional path tracing with classic pairing (bdpt.h, all of
// its techniques), so that light that is hard to find is in them too. They never enter an image, and their random numbers
// are not those of any image.

#include <cstdint>
#include <stop_token>

#include "common/scene/scene.h"
#include "common/tables/train.h"
#include "common/transport/renderer.h"

namespace lightloom {

/// Which part of the dataset a unit traces.
struct TrainingWork {
    uint64_t first_sample = 0;
    uint64_t sample_count = 0;
    uint64_t total_samples = 0;  ///< Of the whole dataset: sets the size of the blocks.
};

/// Samples of a training unit; the last one may have fewer.
inline constexpr uint64_t kTrainingUnitSamples = uint64_t(1) << 14;

/// Traces camera samples first_sample .. of a sequence that is spread evenly over the frame, each with a light sub-path of its own.
/// The result does not depend on the number of threads. kCancelled after a stop request.
Result<TrainingData> trace_training(const Scene& scene, const RenderSettings& settings, const TrainingWork& work,
                                    std::stop_token stop);

/// Training on this machine alone: traces unit by unit, as a coordinator has it done by workers, and trains. The tables have the same
/// bytes as that coordinator's.
Result<SubspaceTables> make_tables(const Scene& scene, const RenderSettings& settings, std::stop_token stop,
                                   TrainingReport* report);

/// Renderer::create() for a process on its own: makes the tables first where the algorithm needs them.
Result<std::unique_ptr<Renderer>> create_with_tables(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                     std::stop_token stop);

}  // namespace lightloom
