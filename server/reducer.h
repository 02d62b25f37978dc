#pragma once
// Reducer: merges the partials of one job. Partials come in any order; groups are folded in ascending order, so that the
// result has the same bytes whatever the order was. Exactly-once by unit key is the caller's duty. It takes memory (256 bytes a
// pixel) from the first partial on: jobs that wait for their turn have none.

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "common/film/grouped_sum.h"
#include "common/work/job.h"

namespace lightloom {

class Reducer {
  public:
    Reducer(const FrameLayout& frame, uint32_t tile_count, const FilmResponse& response = {});

    /// A unit whose partial is not part of the sums after all: it has to be rendered again.
    struct Refusal {
        UnitKey unit;
        Status why;
    };
    /// Takes the partial of `unit` in. Returns the units that were refused: this one, or others that had waited for it, whose
    /// sums leave the range only now. An error is the end of all sums (a complete group does not fit them, or there is no memory
    /// for them: kResourceExhausted); kCancelled after freeze().
    Result<std::vector<Refusal>> add(const WorkUnit& unit, Partial partial);
    /// Nothing is merged any more.
    void freeze();

    /// Complete groups merged so far: always a prefix of the plan.
    uint32_t folded_groups() const;
    uint64_t iterations() const;
    /// Work that went into these groups.
    UnitCounters counters() const;
    /// Non-finite samples that were dropped from these groups, and the first few of them.
    uint64_t dropped() const;
    struct Dropped {
        UnitKey unit;
        DroppedSample sample;
    };
    static constexpr size_t kMaxDropped = 64;
    std::vector<Dropped> first_dropped() const;
    /// Developed complete groups; kFailedPrecondition before the first.
    Result<RgbImage> image() const;
    Result<RgbImage> variance() const;
    /// What `light` means for the image of the complete groups.
    RareLightReport rare_light_report(const RareLight& light) const;

  private:
    Result<std::vector<Refusal>> add_locked(const WorkUnit& unit, Partial partial);
    Status add_to_current(const WorkUnit& unit, const Partial& partial, std::vector<Refusal>& refused);
    uint32_t group_count() const { return sums_ ? sums_->complete().group_count() : 0; }

    const FrameLayout frame_;
    const uint32_t tile_count_;
    const FilmResponse response_;
    mutable std::mutex mutex_;
    std::unique_ptr<GroupedSum> sums_;
    std::vector<Dropped> dropped_;  ///< Also of the group that is being summed: those are the last ones.
    bool frozen_ = false;
    /// Partials of later groups wait as they are: a group's sums take four times their room.
    std::map<uint32_t, std::vector<std::pair<WorkUnit, Partial>>> waiting_;
};

}  // namespace lightloom
