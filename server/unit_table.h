#pragma once
// UnitTable knows which units of one job are pending, leased or merged. It has no locks and no clock of its own: the
// caller passes the time. Leases only save work; correctness rests on complete() answering "first" exactly once per
// unit. Memory: a full record for each unit of an open group, 16 bytes for each unit of a merged one.

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "common/core/digest.h"
#include "common/work/job.h"
#include "server/suspicion.h"
#include "server/time_point.h"

namespace lightloom {

class UnitTable {
  public:
    /// `iterations` 0 means unbounded, until close(). At most `window` groups are open at a time: partials of later
    /// groups have to wait in memory for a straggler of an earlier one. `shuffle_seed` hands units out in a random
    /// order (tests).
    UnitTable(Plan plan, uint64_t iterations, uint32_t window, std::optional<uint64_t> shuffle_seed);

    /// How a worker failed on a unit; `successes` are those that the worker had at the latest failure.
    struct FailedOn {
        int times = 0;
        int before = 0;  ///< Those of `times` after which the worker succeeded with another unit, as known at the latest one.
        uint64_t successes = 0;
    };
    using FailedWorkers = std::map<uint32_t, FailedOn>;
    /// Whether a worker other than these could render a unit.
    using AnyoneElse = std::function<bool(const FailedWorkers& workers)>;
    /// Leases the next unit to `worker` (an index of the caller's choice), or nothing for now. A unit that failed on
    /// the worker comes back to it only if no other worker could render it. Suspects are left out.
    std::optional<WorkUnit> lease(uint32_t worker, TimePoint now, TimePoint expiry, const AnyoneElse& anyone_else = {});
    /// Whether more than `n` units could be leased now by lease().
    bool has_more_than(size_t n);
    /// The same for units that may only run alone, by a worker that holds nothing else.
    std::optional<WorkUnit> lease_suspect(uint32_t worker, TimePoint now, TimePoint expiry, const AnyoneElse& anyone_else = {});
    bool has_suspect();
    /// True if the unit is not merged yet, and was not taken from the worker; then `worker` holds it until `expiry` (unless another
    /// worker already does).
    bool renew(const UnitKey& key, uint32_t worker, TimePoint now, TimePoint expiry);
    /// Gives the unit back if `worker` holds it. If another worker has a copy, that one holds it then.
    void release(const UnitKey& key, uint32_t worker);
    void release_all(uint32_t worker);
    struct Expired {
        UnitKey unit;
        uint32_t worker = 0;
        TimePoint leased;    ///< When the worker got the unit.
        bool alone = false;  ///< Whether it was leased as a suspect.
    };
    /// Puts units back whose lease ended before `now`, and returns them in the order in which they were leased. Copies are
    /// forgotten without a word.
    std::vector<Expired> expire(TimePoint now);
    /// When the lease that ends first does; nothing if no unit is leased.
    std::optional<TimePoint> next_expiry() const;
    /// Holds the silence of a worker against the unit that it rendered; see Suspicion.
    Suspicion::Verdict lose(const Expired& lease, const Suspicion::OthersFellSilent& others);
    const Suspicion& suspicion() const { return suspicion_; }

    /// `worker` says that it renders the unit. Returns since when, or nothing if it does not hold it.
    std::optional<TimePoint> rendering(const UnitKey& key, uint32_t worker, TimePoint now);
    /// A unit that is leased.
    struct InWork {
        WorkUnit unit;
        uint32_t worker = 0;
        TimePoint leased;
        std::optional<TimePoint> begun;  ///< When its worker first said that it renders it.
        bool copied = false;             ///< Whether a second worker has it, too.
    };
    std::vector<InWork> in_work() const;
    /// Leases a unit to a second worker; the first result counts. Nothing if the unit is not leased, is suspect or has a copy.
    std::optional<WorkUnit> copy(const UnitKey& key, uint32_t worker, TimePoint now, TimePoint expiry);
    /// How many copies there are, and were made so far.
    size_t copies() const { return copies_.size(); }
    uint64_t copies_made() const { return copies_made_; }

    enum class Completion { kFirst, kDuplicateSame, kDuplicateDifferent, kUnknown };
    /// Enters a result that arrived. kFirst: the caller merges it; nobody else gets this answer, unless the caller
    /// calls reopen().
    Completion complete(const UnitKey& key, uint32_t worker, const Digest& digest);
    /// How often a unit failed, and on how many different workers.
    struct Failures {
        int total = 0, workers = 0;
        FailedWorkers by = {};
    };
    /// The result could not be merged after all: makes the unit pending again.
    Failures reopen(const UnitKey& key);
    /// The same for a unit that a worker could not render; see lease(). The worker has succeeded with `successes` units so far.
    Failures fail(const UnitKey& key, uint32_t worker, uint64_t successes = 0);

    /// Whether the worker holds the unit, or a copy of it.
    bool is_held(const UnitKey& key, uint32_t worker) const;
    /// Whether a result of the unit has been entered.
    bool is_done(const UnitKey& key) const;
    /// A result that came before this table was made.
    struct Known {
        UnitKey unit;
        uint32_t worker = 0;
        Digest digest;
    };
    /// Makes a new table what another one was when the groups below `merged_groups` had been merged and the results `known` had
    /// come, in any order: all of those groups, and some of later ones, which are opened whatever the window is. Nothing is leased,
    /// and nobody is to blame for anything. kDataLoss, and the table is good for nothing, if a merged group lacks a result, or
    /// a result is not of this table.
    Status restore(uint32_t merged_groups, std::span<const Known> known);

    /// In a table that was restored, opens the unit's group, as far as the window allows: who held a lease when the coordinator
    /// ended may deliver after all.
    void open_for(const UnitKey& key);
    /// The unit of an opened group.
    std::optional<WorkUnit> find(const UnitKey& key) const;
    /// Groups below `count` are merged: the window moves on, and of their units only worker and digest are kept.
    void advance(uint32_t count);
    /// How many groups may be open from now on; at least 1.
    void set_window(uint32_t window) { window_ = std::max(window, 1u); }
    /// From now on nothing is leased.
    void close() { closed_ = true; }
    /// Leases units of the first `count` groups only.
    void limit_groups(uint32_t count);
    /// Whether the units of the job wait until a suspect has been tried.
    bool holds_back_others() const { return suspicion_.holds_back_others(group_limit_); }

    uint64_t unit_total() const { return unit_total_; }  ///< 0 when unbounded.
    uint32_t group_total() const { return group_total_; }
    uint64_t done_count() const { return done_count_; }
    uint64_t leased_count() const { return leased_count_; }
    uint32_t tile_count() const { return plan_.tile_count(); }

    struct Merged {
        UnitKey unit;
        uint32_t worker = 0;
    };
    /// Which worker rendered which unit, over the merged groups.
    std::vector<Merged> merged() const;

  private:
    enum class State : uint8_t { kPending, kLeased, kDone };
    struct Lease {
        uint32_t worker = 0;
        uint64_t ticket = 0;  ///< Later leases have larger ones.
        TimePoint leased, expiry;
        std::optional<TimePoint> begun;
        bool alone = false;
    };
    struct Entry {
        WorkUnit unit;
        State state = State::kPending;
        Lease lease;
        int failures = 0;
        FailedWorkers failed_on;
        std::optional<uint64_t> done_before;  ///< Results of the table when the unit was leased first.
        Digest digest;
    };
    /// The record of a merged unit: who rendered it, and enough of the digest to tell a repeated result from a
    /// different one.
    struct Done {
        uint64_t digest_prefix = 0;
        uint32_t worker = 0;
    };
    static uint64_t prefix(const Digest& digest);
    /// Groups opened so far.
    uint32_t opened_groups() const { return merged_groups_ + uint32_t(open_.size()); }
    /// Group `index` of the job, whose last group may be cut short.
    Group group(uint32_t index) const;
    /// Keys come from the network: a key of another kind or round must not be taken for one of this table.
    bool is_ours(const UnitKey& key) const { return key.tile < tile_count() && key == plan_.key(key.group, key.tile); }
    /// The record of a unit of an open group.
    Entry* entry(const UnitKey& key);
    const Entry* entry(const UnitKey& key) const { return const_cast<UnitTable*>(this)->entry(key); }
    bool open_group();
    /// The same, whatever may be leased.
    void open_next();
    void make_pending(Entry& e);
    /// Takes the lease away; a copy takes its place, otherwise the unit is pending.
    void end_lease(Entry& e);
    void give(Entry& e, const Lease& lease);
    bool has_copy(const UnitKey& key, uint32_t worker) const;
    static Failures failures_of(const Entry& e) { return {e.failures, int(e.failed_on.size()), e.failed_on}; }

    /// A restored group lies at most so many after the merged ones: what is further on was not leased by any coordinator.
    static constexpr uint32_t kMostOpenGroups = 1u << 20;

    Plan plan_;
    uint64_t iterations_;
    uint32_t window_;
    std::optional<uint64_t> shuffle_;
    std::deque<std::vector<Entry>> open_;  // group merged_groups_ and those after it
    std::vector<Done> done_;               // merged groups, tile by tile
    std::set<UnitKey> pending_, leased_;
    std::set<UnitKey> pending_suspects_;  // not in pending_
    Suspicion suspicion_;
    std::map<UnitKey, Lease> copies_;  // of leased units
    uint64_t copies_made_ = 0;
    uint64_t unit_total_ = 0;
    uint32_t group_total_ = 0;
    uint64_t done_count_ = 0, leased_count_ = 0, tickets_ = 0;
    uint32_t merged_groups_ = 0;
    uint32_t group_limit_ = UINT32_MAX;
    bool closed_ = false;
    bool restored_ = false;
};

}  // namespace lightloom
