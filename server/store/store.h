#pragma once
// JobStore: what the coordinator must not forget. Acknowledged means on disk: when a call has returned, or its future is ready with
// OK, then neither SIGKILL nor a power failure takes it back. All changes go through one thread, which commits those that wait
// together: their payloads are appended to the segments, flushed once, and one transaction refers to them. Changes take effect in
// the order in which they were handed over, whoever waits for them.
//
// Errors: kResourceExhausted if the disk is full (nothing of the change is kept; the same call works once there is room),
// kNotFound for a job that is not there, kDataLoss for damaged files, kInternal.

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/store/database.h"
#include "server/store/records.h"

namespace lightloom {

class JobStore {
  public:
    struct Options {
        std::filesystem::path directory;  ///< Made if it is not there; its parent must be. Nobody else uses it.
        /// Called when a flush to disk failed: the kernel may have dropped what it had taken, and only a restart finds out. The
        /// default logs the error and ends the process. If it returns, the store refuses everything from then on.
        std::function<void(const Status&)> flush_failed;
        uint64_t segment_bytes = SegmentLog::kSegmentBytes;
        StoreFiles* files = &StoreFiles::system();
    };
    /// Opens the store, or makes a new one. Besides the errors above: kFailedPrecondition for a store of a newer coordinator, for
    /// one whose database is gone, and for one that another process uses. Files that nothing refers to are deleted.
    static Result<std::unique_ptr<JobStore>> open(Options options);
    /// Commits what was handed over.
    ~JobStore();

    using Done = std::future<Status>;
    /// kAlreadyExists for a job that is known. Its first event comes with it.
    Done put_job(NewJob job, std::optional<StoredEvent> first = {});
    Done update_job(std::string id, JobUpdate update);
    /// The job has ended in `state`, and `info` is what is told of it from now on. Its results and its checkpoint are dropped.
    Done end_job(std::string id, JobState state, std::string message, std::string info);
    /// Nothing is left of the job.
    Done forget_job(std::string id);
    /// Appends a decision, or whatever else has to be known after a restart.
    Done append_event(std::string id, std::string kind, std::string bytes);
    /// The result of a unit is to be made again, because it could not be merged or its payload is damaged.
    Done drop_result(std::string id, UnitKey unit);
    /// All results and the checkpoint are to be made again.
    Done drop_results(std::string id);
    /// Returns when the result is on disk. A repeated result changes nothing; kAlreadyExists if it has another digest.
    Status put_result(const std::string& id, const NewResult& result);
    /// The sums of the first `groups` groups of the image. Returns when they are on disk: then these groups' payloads are dropped,
    /// of their results only who made them is kept. kFailedPrecondition if there is a checkpoint of more groups.
    Status put_checkpoint(const std::string& id, uint32_t groups, std::string_view state);

    /// All jobs, the oldest first.
    Result<std::vector<StoredJob>> load();
    /// Header and payload of a result that has a place. kDataLoss if they are damaged; then see drop_result().
    Result<StoredPayload> read_payload(const StoredResult& result) const;
    /// kDataLoss if it is damaged; then see drop_results().
    Result<std::string> read_checkpoint(const StoredCheckpoint& checkpoint) const;

    /// Transactions since the store was opened; fewer than changes, where several callers wait at a time.
    uint64_t batches() const { return batches_; }

  private:
    /// What a transaction changes outside of the database, once it is committed.
    struct Batch {
        std::map<uint32_t, int64_t> live;  ///< Change of the number of payloads in use, by segment.
        std::vector<std::string> unused_checkpoints;
    };
    using Apply = std::function<Status(Batch&)>;
    struct Change {
        Apply apply;
        std::promise<Status> done;
        Status status;
    };

    JobStore(Options options, Database database, SegmentLog log);
    Status count_live();
    Status drop_leftovers();
    Status delete_unused();
    std::filesystem::path checkpoints() const { return options_.directory / "checkpoints"; }

    Done hand_over(Apply apply);
    void commit_loop(std::stop_token stop);
    void commit(std::span<Change> changes);
    Status try_commit(std::span<Change> changes, Batch& batch);
    void settle(const Batch& batch);
    bool broken();

    // On the committer's thread, inside a transaction.
    Result<int64_t> number_of(const std::string& id);
    /// The same of a job that has not ended: what comes for it later is not kept.
    Result<int64_t> open_number_of(const std::string& id);
    Status insert_result(Batch& batch, const std::string& id, const NewResult& result);
    Status insert_checkpoint(Batch& batch, const std::string& id, const StoredCheckpoint& checkpoint);
    Status drop(Batch& batch, int64_t job);
    Status load_parts(int64_t job, StoredJob& out);

    const Options options_;
    std::mutex database_mutex_;  ///< Guards database_, log_ (but for reading) and live_.
    Database database_;
    SegmentLog log_;
    std::map<uint32_t, int64_t> live_;  ///< Payloads in use, by segment.
    std::optional<Status> broken_;
    std::atomic<uint64_t> batches_{0};
    std::atomic<uint64_t> next_checkpoint_{1};  ///< Names of files.

    std::mutex queue_mutex_;
    std::condition_variable_any queue_changed_;
    std::deque<Change> queue_;
    std::jthread committer_;  ///< The last member: it uses the others.
};

}  // namespace lightloom
