#pragma once
// Agenda: when which job has to be looked at again, so that the ticker sleeps until then. No locks and no clock.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "server/time_point.h"

namespace lightloom {

class Agenda {
  public:
    using JobNumber = uint64_t;

    /// The job is due at `when`, or earlier if it already was. True if nothing else is due before.
    bool at_most(JobNumber job, TimePoint when) {
        const auto known = times_.find(job);
        if (known != times_.end()) {
            if (known->second <= when) return false;
            due_.erase({known->second, job});
        }
        times_[job] = when;
        due_.insert({when, job});
        return due_.begin()->second == job;
    }
    /// The earliest time at which a job is due.
    std::optional<TimePoint> next() const { return due_.empty() ? std::nullopt : std::optional(due_.begin()->first); }
    /// Takes out the jobs that are due.
    std::vector<JobNumber> take_due(TimePoint now) {
        std::vector<JobNumber> jobs;
        while (!due_.empty() && due_.begin()->first <= now) {
            jobs.push_back(due_.begin()->second);
            times_.erase(jobs.back());
            due_.erase(due_.begin());
        }
        return jobs;
    }

  private:
    std::set<std::pair<TimePoint, JobNumber>> due_;
    std::map<JobNumber, TimePoint> times_;
};

}  // namespace lightloom
