#pragma once
// GroupedSum: an image that grows by complete groups, one after the other. Everything that renders a whole job group by group keeps
// its sums in a GroupedSum, so that one place decides what is part of the image: a group counts as a whole or not at all,
// including its counters and dropped samples. (The coordinator's Reducer takes units of several groups at a time.)

#include <cstdint>

#include "common/film/accumulation.h"

namespace lightloom {

class GroupedSum {
  public:
    /// `response` is applied when the image is developed.
    explicit GroupedSum(const FrameLayout& frame, const FilmResponse& response = {})
        : complete_(frame, response),
          current_(frame) {}

    /// Adds a unit of the group that is being summed; units may come in any order, each once. Errors are those of
    /// GroupSum::add(); an error leaves the sums unchanged, and the unit may be rendered again. The first unit allocates
    /// the sums (std::bad_alloc), which serve all groups.
    Status add(const Partial& partial);
    /// Ends the group, all of whose units have been added: it becomes part of the image. Its own sums change places with `*group`,
    /// if that is given. Errors are those of Accumulation::fold(); an error leaves the image unchanged, and no further
    /// group may be added, because this one would be missing.
    Status fold(uint32_t iterations, GroupSum* group = nullptr);
    /// Forgets the units of the group that is being summed.
    void drop_current();

    /// Units of the group that is being summed.
    uint32_t current_units() const { return current_units_; }
    /// All groups that were folded.
    const Accumulation& complete() const { return complete_; }
    /// Work that went into these groups.
    const UnitCounters& counters() const { return counters_; }

  private:
    Accumulation complete_;
    GroupSum current_;
    uint32_t current_units_ = 0;
    UnitCounters counters_, current_counters_;
};

}  // namespace lightloom
