#pragma once
// JobBook: all that the coordinator knows: the jobs by number, id and request, the workers, who makes which tables, who waits for a
// unit, and when to look at which job again. It has no lock of its own: the office keeps it in a Guarded (office.h), and who has
// a JobBook& holds the lock.

#include <condition_variable>
#include <list>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>

#include "server/agenda.h"
#include "server/archive.h"
#include "server/job.h"
#include "server/table_ledger.h"
#include "server/worker_registry.h"

namespace lightloom {

/// A job and what its tasks and watchers need. Shared, because a job may be forgotten while somebody still works for it.
struct JobFile {
    JobFile(Job j, uint64_t n, const std::optional<Digest>& key) : job(std::move(j)), number(n), reuse_key(key) {}

    Job job;                                ///< Only for who holds the lock of the book.
    const uint64_t number;                  ///< In the order of submission.
    const std::optional<Digest> reuse_key;  ///< See JobBook::find_same().
    std::condition_variable_any changed;    ///< With the lock of the book: the job's revision has grown, or the coordinator closes.
    std::stop_source stop;                  ///< Ends the tasks of the job.
    int running_tasks = 0;                  ///< Under the lock of the book. A job is forgotten only when none runs.
    /// What an earlier coordinator left of the job, until it is used up. Under the lock of the book.
    std::shared_ptr<const ArchivedJob> archived;
    uint64_t kept_bytes = 0;     ///< Of results since the last checkpoint. Under the lock of the book.
    bool in_checkpoint = false;  ///< Whether a checkpoint is being written. Under the lock of the book.
    TimePoint spent_noted;       ///< When the archive was told of the time that the job has taken. Under the lock of the book.
};
using JobPtr = std::shared_ptr<JobFile>;

class JobBook {
  public:
    explicit JobBook(double lease_seconds) : workers(lease_seconds) {}

    /// With a `reuse_key` later submissions with the same one may be answered from the job.
    JobPtr add(Job job, const std::optional<Digest>& reuse_key = {});
    /// Null if there is none.
    JobPtr find(const std::string& id) const;
    JobPtr find(uint64_t number) const;
    JobPtr find_request(const std::string& request_id) const;
    /// The job that a submission with this key may be answered from: one that has succeeded with all that was asked for (whose
    /// image may have been removed since: see withdraw()), or that is under way. Null if there is none.
    JobPtr find_same(const Digest& reuse_key) const;
    /// No submission is answered from the job any more.
    void withdraw(const JobFile& file);
    /// All jobs, oldest first; and those that have not ended.
    const std::map<uint64_t, JobPtr>& jobs() const { return jobs_; }
    const std::map<uint64_t, JobPtr>& open_jobs() const { return open_; }
    /// The job has its last state.
    void job_ended(const JobFile& file);
    /// Takes out the oldest jobs that have ended, so that `kept` of them stay; those for which a task runs stay, too.
    std::vector<JobPtr> forget_ended(size_t kept);

    /// The job whose units a worker gets when it is the turn of `file`: the one that makes the tables for which that job waits,
    /// which may be a younger one.
    JobPtr in_its_place(const JobPtr& file) const;
    JobInfo info(const JobFile& file, TimePoint now) const;

    /// A unit that a worker does not hold any more, because it has delivered it or gives it back.
    struct Returned {
        WorkerRecord* worker = nullptr;  ///< Null for an unknown one; then there is nothing else.
        JobPtr file;                     ///< Null for an unknown job.
        UnitTable* units = nullptr;      ///< The job's, if it has units of this kind now.
    };
    Returned take_back(const std::string& worker_id, const UnitReference& unit);

    /// A call that waits for a unit.
    struct Waiter {
        std::condition_variable_any woken;
        bool look = false;  ///< Whether it is to look for a unit now.
    };
    std::list<Waiter*> waiters;  ///< In the order in which they came.
    /// Wakes the first of them that was not woken already.
    void wake_one_waiter() { wake_one_waiter(waiters.begin()); }
    /// The same from that place in the line on: who looked in vain passes on to those behind, so that each looks once.
    void wake_one_waiter(std::list<Waiter*>::iterator from);
    void wake_all_waiters();

    WorkerRegistry workers;
    TableLedger ledger;
    Agenda agenda;
    std::condition_variable_any agenda_changed;  ///< The ticker waits for it: something is due earlier than before.
    /// Why no job gets units: the disk is full. Empty as long as it is not.
    std::string paused;
    bool closing = false;

  private:
    uint64_t next_ = 1;
    std::map<uint64_t, JobPtr> jobs_, open_, ended_;
    std::map<std::string, JobPtr> ids_, requests_;
    std::map<Digest, JobPtr> same_;  ///< By reuse_key.
};

}  // namespace lightloom
