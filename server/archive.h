#pragma once
// Archive: what outlives the coordinator's process. It turns jobs, results and decisions into the bytes that the store keeps
// (server/store), and back. Without a store, as for `lightloom render`, it keeps nothing and every call succeeds.
//
// What it does before somebody is told:
//   a job is accepted       its submission is on disk
//   a unit is acknowledged  its payload is on disk
//   a job may render        its complete spec and the digest of its tables are on disk
//   a job has ended         the image is on disk; that it ended follows at once, and if that is lost the job ends again
//
// Errors: kResourceExhausted if the disk is full; then nothing of the call is kept, and it can be repeated.

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/film/partial_exr.h"
#include "server/job.h"
#include "server/store/store.h"
#include "server/worker_registry.h"

namespace lightloom {

/// What an earlier coordinator of the same directory knew of a job.
struct ArchivedJob {
    Job::Submission submission;
    double age_seconds = 0;                              ///< Since the submission.
    std::optional<JobInfo> last;                         ///< Of a job that has ended: what is told of it.
    std::string build;                                   ///< The one of the results, as name_of() says it.
    std::optional<JobInfo> planned;                      ///< Of a job that rendered: its complete spec and its tables.
    std::optional<JobSpec> settled;                      ///< The spec with the size of training set that a time limit had room for.
    double learning_seconds = 0, rendering_seconds = 0;  ///< Time that was taken of the time limit.
    std::optional<uint32_t> finish_with;                 ///< Groups with which it was told to end.
    bool cancelled = false;                              ///< It was cancelled, and its complete groups are to be written yet.
    std::vector<StoredResult> results;
    std::optional<StoredCheckpoint> checkpoint;
};

class Archive {
  public:
    /// Null: nothing is kept.
    explicit Archive(std::unique_ptr<JobStore> store) : store_(std::move(store)) {}

    bool keeps() const { return store_ != nullptr; }

    // Each returns when it is on disk. `by` names the build whose results are kept from then on.
    Status accept(const Job::Submission& submission, const BuildIdentity& by);
    /// The results of the job are of no use; those of this build will be kept.
    Status begin_anew(const std::string& job_id, const BuildIdentity& by);
    /// `info` has the complete spec and the tables.
    Status plan(const JobInfo& info);
    Status settle(const std::string& job_id, const JobSpec& spec);
    /// The job is to end with its first `groups` groups.
    Status finish(const std::string& job_id, uint32_t groups);
    /// The job is cancelled, and its complete groups are kept: until end() its results stay on disk.
    Status cancel_and_keep(const std::string& job_id);
    /// kAlreadyExists if the unit has a result with other bytes.
    Status keep_partial(const std::string& job_id, const UnitKey& unit, const WorkerRecord& worker, double seconds,
                        const PartialDescriptor& descriptor, std::string_view payload);
    Status keep_training(const std::string& job_id, const UnitKey& unit, const WorkerRecord& worker, double seconds,
                         const Digest& digest, std::string_view payload);
    Status checkpoint(const std::string& job_id, const Reducer::Saved& saved);
    Status end(const JobInfo& info);

    // These come on disk soon, in the order of the calls; what the disk has no room for is owed, see repay().
    void end_soon(const JobInfo& info);
    void forget_soon(const std::string& job_id);
    void spent_soon(const std::string& job_id, double learning_seconds, double rendering_seconds);
    /// The result could not be used and will be made again; or all of the job's.
    void drop_soon(const std::string& job_id, const UnitKey& unit);
    void drop_all_soon(const std::string& job_id);

    /// Tries again what is owed, and waits for it. Whoever has no lock calls it now and then. kResourceExhausted while there is
    /// still no room.
    Status repay();

    /// All jobs, oldest first, and the workers that results name. `unreadable` takes a line for each job that this build cannot
    /// read.
    Result<std::vector<ArchivedJob>> load(const std::filesystem::path& jobs_directory, std::map<uint32_t, WorkerHello>& workers,
                                          std::vector<std::string>& unreadable);
    Result<Partial> read_partial(const StoredResult& result, const PartialExpectation& expected) const;
    /// With the number of bytes as it was received.
    Result<TrainingRound::Part> read_training(const StoredResult& result) const;
    Result<std::string> read_checkpoint(const StoredCheckpoint& checkpoint) const { return store_->read_checkpoint(checkpoint); }

  private:
    /// A change that nobody waits for.
    struct Owed {
        std::string job_id;
        bool drops = false;  ///< Whether it drops results.
        std::function<JobStore::Done()> change;
        JobStore::Done done;
    };
    Result<ArchivedJob> read(const StoredJob& stored, const std::filesystem::path& jobs_directory) const;
    void owe(const std::string& job_id, bool drops, std::function<JobStore::Done()> change);
    Status repay_if(const std::function<bool(const Owed&)>& due);
    /// What is dropped of a job is gone before anything new of it is kept, which it would be taken for otherwise.
    Status repay_drops(const std::string& job_id);

    std::mutex repaying_;    ///< Held while changes are waited for; never taken while the book is open.
    std::mutex owed_mutex_;  ///< Guards the list.
    std::list<Owed> owed_;   ///< In the order of the calls.
    std::unique_ptr<JobStore> store_;
};

/// One line that two builds which render the same pixels have in common.
std::string name_of(const BuildIdentity& identity);

}  // namespace lightloom
