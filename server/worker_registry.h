#pragma once
// WorkerRegistry knows which processes render, when each was last heard of, and what it holds. It has no locks and no
// clock of its own: the caller passes the time. A worker is never forgotten, because units and manifests name it by its
// index.

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/work/service.h"
#include "server/time_point.h"

namespace lightloom {

struct WorkerRecord {
    std::string id;
    uint32_t index = 0;
    WorkerHello hello;
    TimePoint last_heard;
    std::optional<TimePoint> blamed;  ///< The last_heard for whose silence a unit has already been blamed.
    bool left = false;                ///< Whether it said goodbye.
    uint32_t waiting = 0;             ///< Number of its calls for units that wait now.
    uint64_t merged = 0;              ///< Number of merged units of images.
    uint64_t successes = 0;           ///< Number of its results that counted, those of training too.
    int failures_in_a_row = 0;
    TimePoint rests_until;  ///< It gets no unit before then while there are workers that do not rest.
    /// Whether a job failed by its word and it has succeeded with nothing since. Until then its failures alone fail no other job,
    /// and it rests even if all do.
    bool doubted = false;
    std::string trouble;  ///< Why its latest unit failed.
    /// What the host lacks, disk or memory, for the units of a job.
    struct Lack {
        std::string what;
        int times = 0;    ///< In a row.
        TimePoint until;  ///< It gets no unit of the job before then.
    };
    std::map<std::string, Lack> lacks;  ///< By job.
    std::set<UnitReference> held;
    std::set<UnitReference> unconfirmed;   ///< Of these, those that no heartbeat has named yet.
    std::optional<UnitReference> in_work;  ///< Of these, the one that it said it renders; it may have been delivered since.
    /// Of the latest units of `job`; see delivered().
    struct Pace {
        std::string job;
        double samples = 0, seconds = 0;
    } pace;

    /// The suspect that it was given to run alone.
    std::optional<UnitReference> alone;

    /// It has delivered the unit or given it back.
    void lets_go(const UnitReference& unit) {
        held.erase(unit);
        unconfirmed.erase(unit);
    }
    /// A worker may hold one unit beside the one that it renders, so that it does not idle between two; but none beside a suspect.
    bool has_room() const { return held.size() < 2 && !(alone && held.contains(*alone)); }
    /// Camera samples, or light paths, of the job in a second; 0 if nothing has been measured.
    double samples_per_second(const std::string& job_id) const {
        return pace.job == job_id && pace.seconds > 0 ? pace.samples / pace.seconds : 0;
    }
    /// A unit of a job was merged: so many camera samples, or light paths, that took it so many seconds.
    void delivered(const std::string& job_id, double samples, double seconds);
};

class WorkerRegistry {
  public:
    explicit WorkerRegistry(double lease_seconds) : lease_seconds_(lease_seconds) {}

    /// Adds a worker; the reference stays valid.
    WorkerRecord& add(const WorkerHello& hello, TimePoint now);
    /// A worker that had this number under an earlier coordinator, whose results it delivered. It has left.
    void restore(uint32_t index, const WorkerHello& hello);
    /// Finds a worker; null if it is unknown or has left.
    WorkerRecord* find(const std::string& id) const;
    WorkerRecord& at(uint32_t index) const { return *workers_.at(index); }  // throws if there is none

    /// Remembers a worker that was not let in, until one registers from the same host. Only the last few are kept.
    void refuse(const WorkerHello& hello, const std::string& why, TimePoint now);

    /// Number of workers that hold nothing and wait for a unit.
    size_t idle() const;
    /// The workers that were heard of within a lease.
    struct Crew {
        size_t workers = 0;
        uint32_t most_threads = 0;  ///< Most threads of any of them.
    };
    Crew crew(TimePoint now) const;
    /// Whether a worker of whom `but` (its record) is false was heard of within a lease, and does not rest.
    bool anyone_else(const std::function<bool(const WorkerRecord&)>& but, TimePoint now) const;
    /// The same, resting or not.
    bool anyone_there(const std::function<bool(const WorkerRecord&)>& but, TimePoint now) const;
    /// A worker could not render a unit. From the second time in a row it rests, each time longer, up to a minute: its
    /// disk may be full, and it would give every unit back at once. When all workers rest, none does, because then the
    /// job is the cause and has to fail soon.
    void unit_failed(WorkerRecord& worker, const std::string& why, TimePoint now);
    /// A worker lacks disk or memory for the units of a job. It gets none for 1, 2, 4, ... up to 60 s, whoever else there is.
    void lacks(WorkerRecord& worker, const std::string& job_id, const std::string& what, TimePoint now);
    void unit_succeeded(WorkerRecord& worker, const std::string& job_id);
    bool rests(const WorkerRecord& worker, TimePoint now) const;
    static bool rests_from(const WorkerRecord& worker, const std::string& job_id, TimePoint now);
    /// Why none of the workers that are there makes progress with the job, as people need it: which host lacks what. Empty if one
    /// does, or none is there.
    std::string why_nobody_can(const std::string& job_id, TimePoint now) const;
    /// Whether workers other than these (indices) fell silent at `since` or later. One that was heard of within half a lease
    /// did not.
    bool others_fell_silent(const std::set<uint32_t>& but, TimePoint since, TimePoint now) const;
    /// Whether the unit whose lease this worker let expire is blamed for its silence: one unit is for each silence. A
    /// worker that was heard of within half a lease has lost a lease on the way but is alive.
    bool fell_silent(uint32_t index, TimePoint now);
    /// Without those that are gone, or were refused, for longer than `gone_within_seconds`.
    std::vector<WorkerStatus> statuses(TimePoint now, double gone_within_seconds = std::numeric_limits<double>::infinity()) const;

  private:
    WorkerState state(const WorkerRecord& worker, TimePoint now) const;
    bool lost(const WorkerRecord& worker, TimePoint now) const {
        return worker.left || seconds_between(worker.last_heard, now) > lease_seconds_;
    }

    double lease_seconds_;
    WorkerRecord& insert(uint32_t index, const WorkerHello& hello);

    std::map<uint32_t, std::unique_ptr<WorkerRecord>> workers_;  // by index
    std::map<std::string, uint32_t> indices_;                    // by id
    struct Refused {
        WorkerHello hello;
        std::string why;
        TimePoint when;
    };
    std::deque<Refused> refused_;  // oldest first
};

inline Status no_worker(const std::string& id) { return not_found("unknown worker " + id + "; register again"); }

}  // namespace lightloom
