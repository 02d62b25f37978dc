#include "server/reducer.h"

namespace lightloom {

Reducer::Reducer(const FrameLayout& frame, uint32_t tile_count)
    : frame_(frame), tile_count_(tile_count), accumulation_(frame), current_(frame) {}

Result<std::vector<Reducer::Refusal>> Reducer::add(const WorkUnit& unit, Partial partial) {
    const std::lock_guard lock(mutex_);
    if (frozen_) return Status(StatusCode::kCancelled, "the image is being finished");
    std::vector<Refusal> refused;
    if (unit.key.group < accumulation_.group_count()) {
        refused.push_back({unit.key, internal_error("the unit was merged twice")});
        return refused;
    }
    if (partial.tile != unit.tile || partial.samples_per_pixel != unit.iteration_count ||
        partial.light_paths != unit.light_path_count) {
        refused.push_back({unit.key, data_loss("the partial is of another unit")});
        return refused;
    }
    if (unit.key.group > accumulation_.group_count()) {
        if (const auto checked = check_partial(partial, frame_); !checked.ok()) {
            refused.push_back({unit.key, checked.status()});
        } else {
            waiting_[unit.key.group].emplace_back(unit, std::move(partial));
        }
        return refused;
    }
    LL_RETURN_IF_ERROR(add_to_current(unit, partial, refused));
    // A group that has just been folded may have been all that complete later ones waited for.
    for (auto next = waiting_.find(accumulation_.group_count()); next != waiting_.end();
         next = waiting_.find(accumulation_.group_count())) {
        const auto partials = std::move(next->second);
        waiting_.erase(next);
        for (const auto& [waiting_unit, waiting_partial] : partials)
            LL_RETURN_IF_ERROR(add_to_current(waiting_unit, waiting_partial, refused));
    }
    return refused;
}

Status Reducer::add_to_current(const WorkUnit& unit, const Partial& partial, std::vector<Refusal>& refused) {
    if (const Status added = current_.add(partial); !added.ok()) {
        refused.push_back({unit.key, added});
        return {};
    }
    if (++current_units_ < tile_count_) return {};
    LL_RETURN_IF_ERROR(accumulation_.fold(current_, unit.iteration_count));
    current_ = GroupSum(frame_);
    current_units_ = 0;
    return {};
}

void Reducer::freeze() {
    const std::lock_guard lock(mutex_);
    frozen_ = true;
    waiting_.clear();
}

uint32_t Reducer::folded_groups() const {
    const std::lock_guard lock(mutex_);
    return accumulation_.group_count();
}

uint64_t Reducer::iterations() const {
    const std::lock_guard lock(mutex_);
    return accumulation_.iterations();
}

uint64_t Reducer::dropped() const {
    const std::lock_guard lock(mutex_);
    return accumulation_.dropped();
}

Result<RgbImage> Reducer::image(float scale) const {
    const std::lock_guard lock(mutex_);
    if (accumulation_.group_count() == 0)
        return failed_precondition("no group of iterations is complete yet; ask again later");
    return accumulation_.develop(scale);
}

Result<RgbImage> Reducer::variance(float scale) const {
    const std::lock_guard lock(mutex_);
    return accumulation_.variance(scale);
}

}  // namespace lightloom
