#pragma once
// GroupedSum: an image that grows by complete groups, one after the other. Everything that renders or merges a whole
// job keeps its sums in a GroupedSum, so that one place decides what is part of the image: a group counts as a whole or
// not at all, including its counters and dropped samples.

#include <cstdint>
#include <optional>

#include "common/film/accumulation.h"

namespace lightloom {

class GroupedSum {
  public:
    /// `response` is applied when the image is developed.
    explicit GroupedSum(const FrameLayout& frame, const FilmResponse& response = {}) : frame_(frame), complete_(frame, response) {}

    /// Adds a unit of the group that is being summed; units may come in any order, each once. Errors are those of
    /// GroupSum::add(); an error leaves the sums unchanged, and the unit may be rendered again. The first unit of a
    /// group allocates its sums (std::bad_alloc).
    Status add(const Partial& partial);
    /// Ends the group, all of whose units have been added: it becomes part of the image, and its own sums are returned.
    /// Errors are those of Accumulation::fold(); an error leaves the image unchanged, and no further group may be
    /// added, because this one would be missing.
    Result<GroupSum> fold(uint32_t iterations);
    /// Forgets the units of the group that is being summed.
    void drop_current();

    /// Units of the group that is being summed.
    uint32_t current_units() const { return current_units_; }
    /// All groups that were folded.
    const Accumulation& complete() const { return complete_; }
    /// Work that went into these groups.
    const UnitCounters& counters() const { return counters_; }

  private:
    FrameLayout frame_;
    Accumulation complete_;
    std::optional<GroupSum> current_;  ///< Made with the group's first unit, so that waiting jobs take no memory.
    uint32_t current_units_ = 0;
    UnitCounters counters_, current_counters_;
};

}  // namespace lightloom
