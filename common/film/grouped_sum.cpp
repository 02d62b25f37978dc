#include "common/film/grouped_sum.h"

#include <utility>

namespace lightloom {

Status GroupedSum::add(const Partial& partial) {
    LL_RETURN_IF_ERROR(current_.add(partial));
    current_counters_ += partial.counters;
    ++current_units_;
    return {};
}

Status GroupedSum::fold(uint32_t iterations, GroupSum* group) {
    LL_RETURN_IF_ERROR(complete_.fold(current_, iterations));
    counters_ += current_counters_;
    if (group) std::swap(*group, current_);
    drop_current();
    return {};
}

void GroupedSum::drop_current() {
    current_.clear();
    current_units_ = 0;
    current_counters_ = {};
}

}  // namespace lightloom
