#pragma once
// WorkerRegistry: which processes render, when each was last heard of, and what it holds. No locks, no clock of its own: the
// caller passes the time. A worker is never forgotten, because units and manifests name it by its index.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/work/service.h"
#include "server/time_point.h"

namespace lightloom {

struct WorkerStatus {
    std::string worker_id, host;
    uint64_t process_id = 0;
    uint32_t thread_count = 0;
    uint64_t units_merged = 0, units_held = 0;
    double seconds_since_heard = 0;
    bool lost = false;  ///< Not heard of for longer than a lease, or said goodbye.
};

struct WorkerRecord {
    std::string id;
    uint32_t index = 0;
    WorkerHello hello;
    TimePoint last_heard;
    std::optional<TimePoint> blamed;  ///< The last_heard for which a unit bears the blame already.
    bool left = false;                ///< It said goodbye.
    uint32_t waiting = 0;             ///< Of its calls for units, those that wait now.
    uint64_t merged = 0;              ///< Units of images.
    int failures_in_a_row = 0;
    TimePoint rests_until;  ///< Gets no unit before that while others are there that do not rest.
    std::set<UnitReference> held;

    /// A worker may hold one unit beside the one that it renders, so that it does not idle between two.
    bool has_room() const { return held.size() < 2; }
};

class WorkerRegistry {
  public:
    explicit WorkerRegistry(double lease_seconds) : lease_seconds_(lease_seconds) {}

    /// A record that stays where it is.
    WorkerRecord& add(const WorkerHello& hello, TimePoint now);
    /// Null for a worker that is unknown or has left.
    WorkerRecord* find(const std::string& id) const;
    WorkerRecord& at(uint32_t index) const { return *workers_.at(index); }

    /// Workers that hold nothing and wait for a unit.
    size_t idle() const;
    /// Those that were heard of within a lease.
    struct Crew {
        size_t workers = 0;
        uint32_t most_threads = 0;  ///< That one of them has.
    };
    Crew crew(TimePoint now) const;
    /// Whether one of them is not among these (indices) and does not rest.
    bool anyone_else(const std::set<uint32_t>& workers, TimePoint now) const;
    /// A worker could not render a unit. From the second time in a row it rests, every time longer, up to a minute: its disk may be
    /// full, and it would give every unit back at once. When all of them rest, none does: then it is
    /// the job, which is to fail soon.
    void unit_failed(WorkerRecord& worker, TimePoint now);
    void unit_succeeded(WorkerRecord& worker) { worker.failures_in_a_row = 0; }
    bool rests(const WorkerRecord& worker, TimePoint now) const;
    /// Whether the unit whose lease this worker let expire bears the blame for its silence: it does once for each silence. A
    /// worker that was heard of within half a lease has lost a lease on the way, not its life.
    bool fell_silent(uint32_t index, TimePoint now);
    std::vector<WorkerStatus> statuses(TimePoint now) const;

  private:
    bool lost(const WorkerRecord& worker, TimePoint now) const {
        return worker.left || seconds_between(worker.last_heard, now) > lease_seconds_;
    }

    double lease_seconds_;
    std::vector<std::unique_ptr<WorkerRecord>> workers_;  // by index
    std::map<std::string, uint32_t> indices_;             // by id
};

inline Status no_worker(const std::string& id) { return not_found("unknown worker " + id + "; register again"); }

}  // namespace lightloom
