#pragma once
// Office: what the desks of the coordinator share: the book of jobs behind its lock, the files, and the threads. A desk opens the
// book (OpenBook), changes jobs, and notes what has to follow; that is carried out when the book is closed again.
//
// Locks: tables_mutex may be taken before the book, never while the book is open. While it is open only the locks of a reducer and
// of the pool of threads are taken.

#include <functional>

#include "server/coordinator_options.h"
#include "server/guarded.h"
#include "server/job_book.h"
#include "server/table_cache.h"
#include "server/task_pool.h"

namespace lightloom {

class OpenBook;

struct Office {
    /// Without a store nothing outlives the process.
    Office(CoordinatorOptions o, std::unique_ptr<JobStore> store);

    TimePoint now() const { return options.clock(); }
    TimePoint lease_end() const { return seconds_after(now(), options.lease_seconds); }

    const CoordinatorOptions options;
    AssetStore assets;
    const TableCache table_cache;
    Archive archive;  ///< Has its own lock, which is never held while the book is wanted.
    /// Lets a job go on that waited for another job's tables; see release_crowd(). Set once, before there are jobs.
    std::function<void(OpenBook&, const JobPtr&)> resume;
    /// Begins to write the complete groups of a job that has ended without its image; see keep_groups(). Set like `resume`.
    std::function<void(OpenBook&, const JobPtr&)> keep;
    Mutex tables_mutex;  ///< Held while files of tables are written, repaired or removed.
    Guarded<JobBook> book;
    TaskPool tasks;  ///< Last, so that tasks end before what they use.
};

/// The book is open, and its lock held, until close() or the end of the scope.
class OpenBook {
  public:
    explicit OpenBook(Office& office) : office_(office) { access_.emplace(office.book); }
    ~OpenBook() { close(); }
    OpenBook(const OpenBook&) = delete;
    OpenBook& operator=(const OpenBook&) = delete;

    JobBook& operator*() const { return **access_; }
    JobBook* operator->() const { return &**access_; }

    /// Gives the lock back and carries out what was noted.
    void close();
    /// Opens it again after close().
    void reopen() { access_.emplace(office_.book); }
    /// Waits until the condition is notified or `until` is over, with the book closed; what was noted is carried out before, and
    /// then it does not wait, because things may have changed meanwhile.
    template <class Clock, class Duration>
    void wait_until(std::condition_variable_any& condition, std::chrono::time_point<Clock, Duration> until) {
        if (noted()) {
            close();
            reopen();
        } else {
            access_->wait_until(condition, until);
        }
    }

    /// Takes over what a transition of the job asks for: tells those concerned now, and notes the rest.
    void apply(const JobPtr& file, Effects effects);
    /// A change that only those who watch the job see, or wait for its tables.
    void changed(const JobPtr& file);
    /// Units may be leased that could not be before.
    void units_appeared() { (*this)->wake_one_waiter(); }
    /// The job has to be looked at again at `when`.
    void look_again(const JobPtr& file, TimePoint when);
    /// Lines for the log, and large things that are freed without the lock.
    Effects& note() { return noted_; }
    /// The file of these tables may be removed, unless a job needs it by then.
    void drop_tables(const Digest& file) { dropped_.push_back(file); }
    /// The job does not need the file any more.
    void unpin(const JobPtr& file, const Digest& tables) {
        if ((*this)->ledger.unpin(file->number, tables)) drop_tables(tables);
    }
    void fail(const JobPtr& file, const Status& why) { apply(file, file->job.fail(why, office_.now())); }
    /// Those that waited for the tables of the job go on: it has them, or will not make them.
    void release_crowd(const JobPtr& maker);
    /// Forgets the oldest ended jobs, where there are too many.
    void forget_old_jobs();
    /// Runs a task of the job on a thread. The task's error, too little memory or a missing thread fails this job only. `purpose`
    /// completes "the coordinator has too little memory ...".
    /// False if there is no thread.
    bool start(const JobPtr& file, const char* purpose, std::function<Status()> task);
    /// The archive is told that the job has ended.
    void note_end(const JobPtr& file);
    /// Why no job gets units any more, or an empty text if they get some again. Those who watch a job see it.
    void set_paused(std::string why);

  private:
    bool noted() const {
        return !noted_.log.empty() || !noted_.discard.empty() || !dropped_.empty() || !ended_.empty() || !forgotten_.empty();
    }

    Office& office_;
    std::optional<Guarded<JobBook>::Access> access_;
    Effects noted_;
    std::vector<Digest> dropped_;
    std::vector<JobInfo> ended_;          ///< For the archive.
    std::vector<std::string> forgotten_;  ///< The same.
};

/// For whom with_room() waits: for a job until it ends, or until the coordinator closes.
enum class WaitsUntil { kJobEnds, kClosing };
/// Repeats `work` until the disk has room for it; meanwhile no job gets units. kCancelled when there is nothing to wait for any
/// more.
Status with_room(Office& office, const JobPtr& file, const std::function<Status()>& work, WaitsUntil until = WaitsUntil::kJobEnds);
/// What a call is told that names a job which is not there.
Status no_job(const std::string& id);
/// What it is told while the coordinator stops.
Status closing_status();
/// The disk is full: no job gets units until the ticker finds room.
void pause(Office& office, const Status& why);
/// Whether there is room on the disk of the data directory for the coordinator to go on; else a line that says how much there is.
Status check_room(const Office& office);

}  // namespace lightloom
