#pragma once
// Suspicion: the units of one table over which workers fell silent. Hosts go down for many reasons, so a unit is suspect only if
// other units went through meanwhile, and even then only of use is what happens when it runs alone: on a worker that holds nothing
// else, while no other worker falls silent. No locks and no clock; the caller passes what it knows.

#include <cstdint>
#include <functional>
#include <map>
#include <set>

#include "common/work/job.h"
#include "server/time_point.h"

namespace lightloom {

/// A unit is suspect after so many silences, if other units of its table went through since it was leased for the first time, or
/// if there are none.
inline constexpr size_t kSuspectAfter = 2;
/// Where nothing went through, whole farms may be dying; after so many silences the unit is tried alone all the same, and the
/// other units of its job wait, because a job of which every unit kills its worker would never come to an end.
inline constexpr size_t kSuspectWithoutContrast = 4;
/// A suspect that took down so many workers that ran it alone fails its job.
inline constexpr size_t kMaxLostAlone = 3;

class Suspicion {
  public:
    struct Silence {
        uint32_t worker = 0;
        TimePoint leased;       ///< When the worker got the unit.
        bool alone = false;     ///< Whether it held nothing else.
        bool contrast = false;  ///< Whether other units went through since the unit was leased first, or there are none.
        uint64_t results = 0;   ///< Results of the table up to now.
    };
    /// Whether workers other than these fell silent at `since` or later.
    using OthersFellSilent = std::function<bool(const std::set<uint32_t>& but, TimePoint since)>;

    enum class Verdict { kNothing, kSuspect, kGuilty };
    Verdict fell_silent(const UnitKey& unit, const Silence& silence, const OthersFellSilent& others);
    /// The worker is alive and still has the unit: what was held against the unit for its silence is taken back.
    void returned(const UnitKey& unit, uint32_t worker);
    /// A result of the unit has come.
    void acquit(const UnitKey& unit) { units_.erase(unit); }

    bool empty() const { return units_.empty(); }
    bool suspects(const UnitKey& unit) const;
    /// Whether the suspect may run now. After it took down a worker, another unit has to go through first, where there are
    /// others, so that dying farms do not look like its doing.
    bool may_run(const UnitKey& unit, uint64_t results, bool are_others) const;
    /// Whether a unit is suspect of whose table nothing went through, so that nothing else of it is to be leased.
    bool holds_back_others(uint32_t group_limit = UINT32_MAX) const;
    /// The workers that a unit has taken down; those that ran it alone.
    std::set<uint32_t> lost(const UnitKey& unit) const;
    std::set<uint32_t> lost_alone(const UnitKey& unit) const;

  private:
    struct Trial {
        std::set<uint32_t> lost, alone;
        bool contrast = false;  ///< As of the last silence.
        TimePoint first_run;    ///< When the first of `alone` got the unit.
        uint64_t results = 0;   ///< Of the table, when the last of `alone` fell silent.
        bool suspect() const { return lost.size() >= (contrast ? kSuspectAfter : kSuspectWithoutContrast); }
    };
    const Trial* find(const UnitKey& unit) const;

    std::map<UnitKey, Trial> units_;  // only those over which workers fell silent
};

}  // namespace lightloom
