#pragma once
// Reducer: merges the partials of one job. Partials come in any order; groups are folded in ascending order, so that
// the result has the same bytes whatever the order was. The caller makes sure that each unit is added exactly once (by
// its key). It takes memory (256 bytes per pixel) only from the first partial on, so that waiting jobs take none.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "common/film/grouped_sum.h"
#include "common/work/job.h"
#include "common/work/service.h"

namespace lightloom {

/// The image of the complete groups.
struct DevelopedImage {
    RgbImage color, variance;  ///< The latter is empty where it is not known.
    uint64_t iterations = 0;
    uint32_t groups = 0;
};

/// Rec.709, over all pixels; 0 for an empty image.
double mean_luminance(const RgbImage& image);

class Reducer {
  public:
    /// Once the error of the image is not above `noise_target` (0: none), later groups are dropped: see noise().
    Reducer(const FrameLayout& frame, uint32_t tile_count, const FilmResponse& response = {}, double noise_target = 0);

    /// A unit whose partial could not be added to the sums: it has to be rendered again.
    struct Refusal {
        UnitKey unit;
        Status why;
    };
    /// Adds the partial of `unit`. Returns the units that were refused: this one, or others that had waited for it and
    /// whose sums exceed the range only now. After an error nothing more can be added (a complete group does not fit
    /// them, or there is no memory for them: kResourceExhausted); kCancelled after freeze().
    Result<std::vector<Refusal>> add(const WorkUnit& unit, Partial partial);
    /// From now on nothing is merged.
    void freeze();

    /// Complete groups merged so far: always a prefix of the plan.
    uint32_t folded_groups() const;
    uint64_t iterations() const;
    /// Work for these groups.
    UnitCounters counters() const;
    /// Non-finite samples that were dropped from these groups, and the first few of them.
    uint64_t dropped() const;
    struct Dropped {
        UnitKey unit;
        DroppedSample sample;
    };
    static constexpr size_t kMaxDropped = 64;
    std::vector<Dropped> first_dropped() const;
    /// Develops the complete groups, with their variance if that is asked for; kFailedPrecondition before the first. Results are
    /// taken in meanwhile: the lock is held for a part of the frame at a time. When a group was completed between two parts, all
    /// begins again (a few times; then results wait until it is done). `between` is called between two parts (tests).
    Result<DevelopedImage> developed(bool with_variance, const std::function<void()>& between = {}) const;
    static constexpr size_t kPixelsAtATime = size_t(1) << 16;
    /// The error of the complete groups, as of the last time that it was estimated: at the numbers of groups that
    /// NoiseEstimate::next_groups() gives, whatever the order and number of the results that came. `reached` never changes back.
    std::optional<NoiseReport> noise() const;
    /// The same of exactly these groups, which takes time in proportion to the pixels.
    std::optional<NoiseReport> final_noise() const;
    /// The consequences of the first unit's RareLight for the image of the complete groups, whose mean luminance is `image_mean`.
    RareLightReport rare_light_report(double image_mean) const;

  private:
    Result<std::vector<Refusal>> add_locked(const WorkUnit& unit, Partial partial);
    Status add_to_current(const WorkUnit& unit, const Partial& partial, std::vector<Refusal>& refused);
    std::optional<NoiseReport> estimate_noise() const;
    RareLightReport rare_light_of(double image_mean) const;
    uint32_t group_count() const { return sums_ ? sums_->complete().group_count() : 0; }

    const FrameLayout frame_;
    const uint32_t tile_count_;
    const FilmResponse response_;
    const double noise_target_;
    mutable std::mutex mutex_;
    std::unique_ptr<GroupedSum> sums_;
    std::vector<Dropped> dropped_;  ///< Including those of the group that is being summed, which are the last.
    RareLight rare_light_;          ///< From the first unit.
    std::optional<NoiseReport> noise_;
    uint32_t next_noise_groups_ = NoiseEstimate::next_groups(0);
    bool frozen_ = false;
    /// Partials of later groups wait unmerged, because a group's sums would take four times their memory.
    std::map<uint32_t, std::vector<std::pair<WorkUnit, Partial>>> waiting_;
};

}  // namespace lightloom
