#include <algorithm>
#include <cmath>

#include "common/work/job.h"

namespace lightloom {
namespace {

/// Camera samples of an iteration of a tile, at most approximately. Tiles of small frames are not cut further, because every unit's
/// splats go to the whole frame.
constexpr int64_t kTileSamples = RenderUnit::kBatchSamples;
/// Camera samples of a unit of several iterations. At 70000 a second, which a slow thread makes of `bdpt`, the larger one takes a
/// minute; samples that share light sub-paths take about twice as long.
constexpr int64_t kUnitSamples = int64_t(1) << 22, kSharingUnitSamples = kUnitSamples / 2;
/// Iterations over which a partial's bytes (24 or 48 for a pixel) and its merging are spread well enough. Small frames, whose units
/// could have more of them, gain nothing beyond: a job with a time limit drops the groups that are not complete at its end.
constexpr int64_t kEnoughIterations = 32;
constexpr int kTileWidth = 512;  // approximate: tiles are equal parts of the crop window
constexpr int kMinTileRows = 256;
constexpr int64_t kWholeFrameIterations = 8;  // groups of whole frames may grow to this, however large the frame is

int ceil_div(int64_t a, int64_t b) { return int((a + b - 1) / b); }

std::vector<Rect> make_tiles(const Rect& crop, bool whole_frame) {
    if (whole_frame || crop.area() <= kTileSamples) return {crop};
    const int columns = ceil_div(crop.width(), kTileWidth);
    const int64_t rows_per_tile = std::max<int64_t>(kMinTileRows, kTileSamples / ceil_div(crop.width(), columns));
    const int rows = ceil_div(crop.height(), rows_per_tile);
    std::vector<Rect> tiles;
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            tiles.push_back({crop.x0 + int(int64_t(crop.width()) * i / columns), crop.y0 + int(int64_t(crop.height()) * j / rows),
                             crop.x0 + int(int64_t(crop.width()) * (i + 1) / columns),
                             crop.y0 + int(int64_t(crop.height()) * (j + 1) / rows)});
        }
    }
    return tiles;
}

/// Iterations of the group that follows `done` iterations.
uint32_t group_size(uint64_t done, uint32_t cap) { return uint32_t(std::clamp<uint64_t>(done / 20, 1, cap)); }

}  // namespace

PlanOptions plan_options(const FrameLayout& frame, const AlgorithmSettings& algorithm) {
    return {.light_paths_per_iteration = algorithm.light_paths_per_iteration(frame.crop.area()),
            .whole_frame = algorithm.frame() == FrameShape::kWhole,
            .splats_only = !algorithm.info().camera_samples,
            .shares_light_paths = algorithm.info().shares_light_paths};
}

std::vector<WorkUnit> split_group(const Group& group, const std::vector<Rect>& tiles, const PlanOptions& options) {
    int64_t area = 0;
    for (const Rect& tile : tiles) area += tile.area();
    const uint64_t total = options.light_paths_per_iteration * group.iteration_count;
    // The rounding is cumulative and in integers: the shares differ from the exact proportion by less than one path and
    // add up to the total, whatever the tiles are.
    std::vector<WorkUnit> units;
    units.reserve(tiles.size());
    int64_t pixels = 0;
    uint64_t first = 0;
    for (uint32_t t = 0; t < tiles.size(); ++t) {
        pixels += tiles[t].area();
        const uint64_t last = uint64_t((unsigned __int128)(total)*uint64_t(pixels) / uint64_t(area));
        units.push_back({.key = {group.index, t},
                         .render = {.first_iteration = group.first_iteration,
                                    .iteration_count = group.iteration_count,
                                    .group_first_iteration = group.first_iteration,
                                    .tile = tiles[t],
                                    .first_light_path = first,
                                    .light_path_count = last - first,
                                    .splats_only = options.splats_only}});
        first = last;
    }
    return units;
}

Plan::Plan(const FrameLayout& frame, const PlanOptions& options)
    : options_(options),
      tiles_(make_tiles(frame.crop, options.whole_frame)) {
    int64_t largest = 1;
    for (const Rect& tile : tiles_) largest = std::max(largest, tile.area());
    // The partial of a large whole frame is large, so that its groups should not stay at one iteration for ever.
    const int64_t least = options.whole_frame ? kWholeFrameIterations : 1;
    const int64_t most = (options.shares_light_paths ? kSharingUnitSamples : kUnitSamples) / largest;
    max_group_iterations_ = uint32_t(std::max({least, kTileSamples / largest, std::min(most, kEnoughIterations)}));
}

Plan Plan::training(UnitKind kind, uint32_t round, const TrainingWork& work) {
    Plan plan;
    plan.tiles_.resize(1);
    plan.max_group_iterations_ = uint32_t(kTrainingUnitSamples);
    plan.kind_ = kind;
    plan.round_ = round;
    plan.training_ = work;
    return plan;
}

Group Plan::group(uint32_t index) const {
    if (kind_ != UnitKind::kRender) {
        const uint64_t first = std::min(uint64_t(index) * kTrainingUnitSamples, training_.sample_count);
        return {index, first, uint32_t(std::min(kTrainingUnitSamples, training_.sample_count - first))};
    }
    uint64_t done = 0;
    for (uint32_t i = 0; i < index; ++i) {
        const uint32_t size = group_size(done, max_group_iterations_);
        // From here on every group has the largest size, so that a product replaces the loop.
        if (size == max_group_iterations_) {
            done += uint64_t(index - i) * size;
            break;
        }
        done += size;
    }
    return {index, done, group_size(done, max_group_iterations_)};
}

std::vector<Group> Plan::groups_for(uint64_t iterations) const {
    std::vector<Group> groups;
    uint64_t done = 0;
    while (done < iterations) {
        const uint64_t size = std::min<uint64_t>(group_size(done, max_group_iterations_), iterations - done);
        groups.push_back({uint32_t(groups.size()), done, uint32_t(size)});
        done += size;
    }
    return groups;
}

uint32_t Plan::group_count(uint64_t iterations) const {
    if (kind_ != UnitKind::kRender) return uint32_t((iterations + kTrainingUnitSamples - 1) / kTrainingUnitSamples);
    uint64_t done = 0, count = 0;
    while (done < iterations) {
        const uint32_t size = group_size(done, max_group_iterations_);
        if (size == max_group_iterations_) return uint32_t(count + (iterations - done + size - 1) / size);
        done += size;
        ++count;
    }
    return uint32_t(count);
}

std::vector<WorkUnit> Plan::units(const Group& group) const {
    if (kind_ != UnitKind::kRender) {
        return {{.key = {group.index, 0, kind_, round_},
                 .training = {training_.first_sample + group.first_iteration, group.iteration_count, training_.total_samples}}};
    }
    return split_group(group, tiles_, options_);
}

}  // namespace lightloom
