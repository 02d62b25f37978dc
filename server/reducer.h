#pragma once
// Reducer: merges the partials of one job. Partials come in any order and are added to their group's sums at once; groups are
// folded in ascending order, so that the result has the same bytes whatever the order was. The caller makes sure that each unit is
// added exactly once (by its key). Waiting jobs take no memory. From the first partial on it is, per pixel, 48 bytes for the image
// and 24 for each open group, and 24 more for both where light paths splat (upper words of sums above 2^20 come on top).

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/film/accumulation.h"
#include "common/work/job.h"
#include "common/work/service.h"
#include "server/reducer_state.h"

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

    /// Adds the partial of `unit`. Returns why it could not be added to its group's sums, if it could not: then the unit has to
    /// be rendered again. After an error nothing more can be added (a complete group does not fit the image's sums, or
    /// there is no memory for them: kResourceExhausted); kCancelled after freeze().
    Result<std::optional<Status>> add(const WorkUnit& unit, const Partial& partial);
    /// From now on nothing is merged, and the sums of groups that are not complete are gone.
    void freeze();

    /// Bytes per pixel of the sums of an open group.
    static constexpr uint64_t open_group_bytes(bool splats) { return splats ? 48 : 24; }

    /// Complete groups merged so far: always a prefix of the plan.
    uint32_t folded_groups() const;
    uint64_t iterations() const;
    /// Work for these groups.
    UnitCounters counters() const;
    /// Non-finite samples that were dropped from these groups, and the first few of them.
    uint64_t dropped() const;
    using Dropped = DroppedOfUnit;
    static constexpr size_t kMaxDropped = 64;
    std::vector<Dropped> first_dropped() const;
    /// Develops the complete groups, with their variance if that is asked for; kFailedPrecondition before the first. Results are
    /// taken in meanwhile: the lock is held for a part of the frame at a time. When a group was completed between two parts, all
    /// begins again (a few times; then results wait until it is done). `between` is called between two parts (tests).
    Result<DevelopedImage> developed(bool with_variance, const std::function<void()>& between = {}) const;
    static constexpr size_t kPixelsAtATime = size_t(1) << 16;
    /// The error of the complete groups, as of the last time that it was estimated: when
    /// NoiseEstimate::is_due(), whatever the order and number of the results that came. `reached` never changes back.
    std::optional<NoiseReport> noise() const;
    /// The same of exactly these groups, which takes time in proportion to the pixels.
    std::optional<NoiseReport> final_noise() const;
    /// The state of the complete groups, and how many they are.
    struct Saved {
        uint32_t groups = 0;
        std::string bytes;
    };
    /// kFailedPrecondition before the first complete group. Results wait while the sums are copied, for some 50 ms for each
    /// 10^6 pixels; takes as much memory as these sums.
    Result<Saved> serialize() const;
    /// Gives a reducer that was made with the same arguments, and has got no partial yet, the complete groups of another one: from
    /// then on it is as if it had merged them itself. Units of groups that were open have to be added again. Errors are those of
    /// decode_reducer_state(); then it is as new.
    Status restore(std::string_view bytes);
    /// The consequences of the first unit's RareLight for the image of the complete groups, whose mean luminance is `image_mean`.
    RareLightReport rare_light_report(double image_mean) const;

  private:
    /// A group of which not all units have come, or which waits for an earlier one.
    struct OpenGroup {
        GroupSum sum;
        uint32_t iterations = 0, units = 0;
        UnitCounters counters;
        std::vector<Dropped> dropped;  ///< At most Reducer::kMaxDropped.
    };
    Result<std::optional<Status>> add_locked(const WorkUnit& unit, const Partial& partial);
    OpenGroup& open(const WorkUnit& unit);
    /// Adds the lowest open group, which is complete, to the image.
    Status fold();
    void drop_open_groups();
    std::optional<NoiseReport> estimate_noise() const;
    RareLightReport rare_light_of(double image_mean) const;
    uint32_t group_count() const { return complete_ ? complete_->group_count() : 0; }

    const FrameLayout frame_;
    const uint32_t tile_count_;
    const FilmResponse response_;
    const double noise_target_;
    mutable std::mutex mutex_;
    std::optional<Accumulation> complete_;  ///< All groups that were folded; made with the first partial.
    UnitCounters counters_;                 ///< Of these groups.
    std::vector<Dropped> dropped_;          ///< From these groups, in their order.
    std::map<uint32_t, OpenGroup> open_;    ///< By index.
    std::optional<GroupSum> spare_;         ///< The empty sums of a group that was folded, for the next one to be opened.
    RareLight rare_light_;                  ///< From the first unit.
    std::optional<NoiseReport> noise_;
    bool frozen_ = false;
};

}  // namespace lightloom
