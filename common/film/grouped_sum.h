#pragma once
// GroupedSum: an image that grows by complete groups, one after the other. Everything that renders or merges a whole job keeps its
// sums in one of these, so that what counts as part of the image is decided once: a group does as a whole or not at all, with its
// counters and its dropped samples.

#include <cstdint>
#include <optional>

#include "common/film/accumulation.h"

namespace lightloom {

class GroupedSum {
  public:
    /// `response` develops the image.
    explicit GroupedSum(const FrameLayout& frame, const FilmResponse& response = {}) : frame_(frame), complete_(frame, response) {}

    /// Adds a unit of the group that is being summed; units come in any order, each once. An error refuses this unit alone: the
    /// sums are as they were, and it may be rendered again. As GroupSum::add(); takes the memory of a group's sums
    /// (std::bad_alloc).
    Status add(const Partial& partial);
    /// Ends the group, all of whose units have been added: it becomes part of the image. Gives its own sums. An error: the group
    /// does not fit and the image is as it was. Later groups would leave a hole where it belongs, so this is the end of all sums.
    /// As Accumulation::fold().
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
    std::optional<GroupSum> current_;  ///< From its first unit on: renderings that wait for their turn have none.
    uint32_t current_units_ = 0;
    UnitCounters counters_, current_counters_;
};

}  // namespace lightloom
