#include "server/training_round.h"

#include <algorithm>

namespace lightloom {

TrainingRound::TrainingRound(UnitKind kind, uint32_t number, const TrainingWork& work, std::optional<uint64_t> shuffle_seed)
    : kind_(kind),
      number_(number),
      work_(work),
      units_(Plan::training(kind, number, work), work.sample_count, UINT32_MAX, shuffle_seed),
      parts_(units_.group_total()) {}

uint64_t TrainingRound::samples_done() const {
    return work_.first_sample + std::min(work_.sample_count, units_.done_count() * kTrainingUnitSamples);
}

void TrainingRound::add(uint32_t unit, Part part) {
    bytes_ += part.bytes;
    traced_seconds_ += part.seconds;
    parts_[unit] = std::move(part);
}

double TrainingRound::projected_bytes() const { return double(bytes_) * units_.group_total() / double(units_.done_count()); }

std::vector<TrainingRound::Part> TrainingRound::take() {
    auto parts = std::move(parts_);
    parts_.resize(units_.group_total());
    return parts;
}

UnitTable::Failures TrainingRound::refuse(uint32_t unit) {
    bytes_ -= parts_[unit].bytes;
    traced_seconds_ -= parts_[unit].seconds;
    parts_[unit] = {};
    return units_.reopen(key(unit));
}

Result<TrainingData> join(TrainingData all, std::vector<TrainingRound::Part> parts, std::stop_token stop) {
    std::vector<const TrainingData*> data;
    for (const TrainingRound::Part& part : parts) data.push_back(&part.data);
    all.reserve_for(data);
    for (TrainingRound::Part& part : parts) {
        if (stop.stop_requested()) return Status(StatusCode::kCancelled, "stopped while training data were joined");
        LL_RETURN_IF_ERROR(all.append(part.data));
        part = {};  // so that only one part at a time is held twice
    }
    return all;
}

uint64_t energy_paths(const JobSpec& spec, const TrainingWork& work) {
    const LearningPlan plan = learning_plan(spec.algorithm);
    return plan.energy_paths_before(work.first_sample + work.sample_count) - plan.energy_paths_before(work.first_sample);
}

uint64_t largest_training_payload(const JobSpec& spec, const TrainingWork& work) {
    // The bound counts the paths that samples keep, one more for each sample's light sub-path, and the light sub-paths,
    // all of the greatest length, and a sum per block of the frame.
    const FrameLayout& frame = spec.frame;
    const uint64_t most_blocks = kTrainingBlocks + uint64_t(frame.crop.width() + frame.crop.height() + 1);
    const uint64_t blocks = std::min(uint64_t(frame.crop.area()), most_blocks);
    const uint64_t path = sizeof(TrainingPath) + uint64_t(spec.max_depth + 3) * sizeof(TrainingVertex);
    const uint64_t paths = (kTrainingPathsPerSample + 1) * work.sample_count + energy_paths(spec, work);
    uint64_t bytes = 256 + blocks * sizeof(double) + paths * path;
    if (learning_plan(spec.algorithm).keeps_visits)
        bytes += blocks * sizeof(double) + work.sample_count * uint64_t(spec.max_depth + 2) * sizeof(TrainingVisit);
    return bytes;
}

Status check_unit_data(const TrainingData& data, const JobSpec& spec, const TrainingWork& work) {
    const FrameBlocks blocks(spec.frame.crop);
    const bool visits = learning_plan(spec.algorithm).keeps_visits;
    if (data.samples != work.sample_count || data.light_samples != energy_paths(spec, work) || data.blocks_x != blocks.columns() ||
        data.blocks_y != blocks.rows() || data.block_square.empty() == visits || (!visits && !data.visits.empty()))
        return data_loss("the training data are those of another unit");
    // Checks that need the scene's lights are made by the task that has built the scene.
    return data.validate(SIZE_MAX);
}

}  // namespace lightloom
