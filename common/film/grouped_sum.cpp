#include "common/film/grouped_sum.h"

#include <utility>

namespace lightloom {

Status GroupedSum::add(const Partial& partial) {
    if (!current_) current_.emplace(frame_);
    LL_RETURN_IF_ERROR(current_->add(partial));
    current_counters_ += partial.counters;
    ++current_units_;
    return {};
}

Result<GroupSum> GroupedSum::fold(uint32_t iterations) {
    if (!current_) current_.emplace(frame_);  // An empty group is refused like any other incomplete one.
    LL_RETURN_IF_ERROR(complete_.fold(*current_, iterations));
    counters_ += current_counters_;
    GroupSum group = *std::move(current_);
    drop_current();
    return group;
}

void GroupedSum::drop_current() {
    current_.reset();
    current_units_ = 0;
    current_counters_ = {};
}

}  // namespace lightloom
