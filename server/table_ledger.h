#pragma once
// TableLedger knows which job makes which tables, which jobs wait for it, and which table files are needed. Jobs are numbers in the
// order of their submission. It has no locks, no clock and no files.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "common/core/digest.h"

namespace lightloom {

class TableLedger {
  public:
    using JobNumber = uint64_t;

    /// From now on `job` makes the tables of `key`, and of no other key. Only for a job that knows which set it trains on: others
    /// could wait for tables that never come.
    void make(JobNumber job, const Digest& key);
    /// `job` makes none (any more): they exist, it failed, or it does not know yet which.
    void stop_making(JobNumber job);
    /// The oldest other job that makes the tables of `key`.
    std::optional<JobNumber> maker_of(const Digest& key, JobNumber but) const;

    /// `job` waits for the tables of `maker`. It must make none itself, and so there is no circle.
    void wait(JobNumber job, JobNumber maker);
    void stop_waiting(JobNumber job);
    std::optional<JobNumber> waits_for(JobNumber job) const;
    /// All jobs that wait for `maker`, oldest first.
    std::vector<JobNumber> waiting_for(JobNumber maker) const;
    /// The job itself, or the job at the end of the chain of those that it waits for.
    JobNumber maker_of_last_resort(JobNumber job) const;

    /// `job` needs the file of that digest. A zero digest is no file.
    void pin(JobNumber job, const Digest& file);
    /// `job` does not need it any more. True if nobody does.
    bool unpin(JobNumber job, const Digest& file);
    bool pinned(const Digest& file) const { return pins_.contains(file); }
    std::set<Digest> pinned_files() const;
    /// `job` has ended: it makes nothing, waits for nothing and needs nothing. Returns the files that nobody needs any more.
    std::vector<Digest> forget(JobNumber job);

  private:
    std::map<Digest, std::set<JobNumber>> makers_;    // by key of the tables
    std::map<JobNumber, Digest> makes_;               // the same by job
    std::map<JobNumber, JobNumber> waits_;            // the maker by the job that waits
    std::map<JobNumber, std::set<JobNumber>> crowd_;  // the same by maker
    std::map<Digest, std::set<JobNumber>> pins_;      // by file
    std::map<JobNumber, std::set<Digest>> files_;     // the same by job
};

}  // namespace lightloom
