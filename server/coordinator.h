#pragma once
// Coordinator: accepts jobs, leases their units to workers, merges each result exactly once, and writes the image. For
// algorithms that need tables it first lets workers trace the training set, and learns the tables itself
// (coordinator_learn.cpp). It does not render, and gRPC is kept to its callers (grpc_services.h); leases and measured
// durations follow an injected clock. Safe for any number of threads.

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "common/film/partial_exr.h"
#include "common/work/service.h"
#include "server/scene_facts.h"
#include "server/table_cache.h"
#include "server/unit_table.h"
#include "server/worker_registry.h"

namespace lightloom {

struct JobRecord;
struct LearnedTables;

struct CoordinatorOptions {
    std::filesystem::path directory;  ///< Assets and finished images; made if need be.
    BuildIdentity identity;           ///< A worker must have the same.
    SceneReader read_scene;
    bool scene_files_needed = true;  ///< False where read_scene and the workers have the files by other means.
    double lease_seconds = 10;
    double heartbeat_seconds = 1;
    std::optional<uint64_t> shuffle_seed;  ///< Lease units in a random order (tests).
    /// Called by any thread at any time.
    std::function<TimePoint()> clock = [] { return std::chrono::steady_clock::now(); };
    /// Memory of the host, into which a frame's sums must fit. 0: as the system reports it.
    int64_t memory_bytes = 0;
    uint64_t waiting_bytes = uint64_t(512) << 20;  ///< Most memory for the sums of groups that wait for earlier ones.
    std::filesystem::path table_cache;             ///< Tables of earlier jobs; empty: none are kept.
    uint64_t table_cache_bytes = uint64_t(4) << 30;
    uint64_t training_bytes = uint64_t(8) << 30;  ///< Most training data of one job: 7e6 samples of a hard interior.
    size_t max_jobs = 10000;                      ///< Most jobs that have not ended.
    size_t kept_jobs = 1000;                      ///< Ended jobs that are remembered; the oldest are forgotten, their files stay.
};

/// The answer to a result for which expected_partial() or expected_training_bytes() failed: a result that comes too
/// late is stale, any other is rejected.
SubmitAck unexpected_result(const Status& why);

class Coordinator {
  public:
    explicit Coordinator(CoordinatorOptions options);
    ~Coordinator();

    AssetStore& assets() { return assets_; }

    // Jobs; see JobService for the errors.
    Result<JobInfo> submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label = {});
    Result<JobInfo> get_job(const std::string& job_id) const;
    std::vector<JobInfo> list_jobs() const;
    Result<JobInfo> cancel_job(const std::string& job_id);
    /// The job once its revision is above `after`, or as it is after `timeout_seconds`.
    Result<JobInfo> wait_job(const std::string& job_id, uint64_t after, double timeout_seconds) const;
    /// Returns once the job has ended, or after `timeout_seconds`.
    Status wait_job_end(const std::string& job_id, double timeout_seconds) const;
    Result<std::string> image(const std::string& job_id, ImageKind kind) const;
    Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure = 0) const;
    Result<std::string> manifest(const std::string& job_id) const;

    // Workers; see WorkerService for the errors.
    Result<WorkerGrant> register_worker(const WorkerHello& hello);
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds,
                                               const std::function<bool()>& cancelled);
    /// Makes calls of lease_units() look at `cancelled` now; they do so by themselves ten times a second.
    void wake_leases();
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running);
    Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why);
    Status goodbye(const std::string& worker_id);
    /// What the payload of a unit must be, for limits before bytes are received; kNotFound if the job or unit is not
    /// open.
    Result<PartialExpectation> expected_partial(const UnitReference& unit) const;
    /// Takes a partial that came over the wire; it is checked against the unit before anything reads it.
    Result<SubmitAck> submit_payload(const std::string& worker_id, const UnitReference& unit, const PartialDescriptor& descriptor,
                                     std::string_view payload, double render_seconds = 0);
    /// Takes a partial from this process. `digest` is its payload's; `render_seconds` is the time that it took, or 0 if nobody has
    /// measured that.
    Result<SubmitAck> submit_partial(const std::string& worker_id, const UnitReference& unit, const Digest& digest, Partial partial,
                                     double render_seconds = 0);
    /// Most bytes of the training data of a unit; errors as those of expected_partial().
    Result<uint64_t> expected_training_bytes(const UnitReference& unit) const;
    /// Takes serialized training data, which are checked against digest and unit before they count.
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitReference& unit, const Digest& digest,
                                      std::string_view payload, double trace_seconds);
    std::vector<WorkerStatus> workers(double gone_within_seconds = std::numeric_limits<double>::infinity()) const;

  private:
    /// The pointer is shared, because a job may be forgotten while a caller works without the mutex.
    std::shared_ptr<JobRecord> find_job(const std::string& job_id) const;
    TimePoint lease_end() const { return seconds_after(options_.clock(), options_.lease_seconds); }
    void changed(JobRecord& job);
    Result<JobSpec> canonical_spec(const JobSpec& spec) const;
    /// Whether the scene's files are here; the path of the scene file among them.
    Result<std::string> check_assets(const JobSpec& spec) const;
    void fail_job(JobRecord& job, const Status& why);
    void end_job(JobRecord& job, JobState state);
    /// Runs a task on a thread of the job's own. The task's error, too little memory or a missing thread fails this job
    /// only; returns false if there is no thread. `purpose` completes "the coordinator has too little memory ...". The
    /// caller holds mutex_.
    bool start_task(JobRecord& job, std::jthread* thread, const char* purpose, std::function<Status(std::stop_token)> task);
    void run_task(JobRecord& job, const char* purpose, const std::function<Status()>& task);
    Status prepare(JobRecord& job, std::stop_token stop);
    void plan_units(JobRecord& job, JobSpec spec, SceneFacts facts, TablesInfo tables);
    Status prepare_tables(JobRecord& job, JobSpec spec, SceneFacts facts, bool may_wait);
    std::shared_ptr<JobRecord> find_maker(const JobRecord& job) const;
    /// True if another job makes the tables of `table_key`; this job then waits for them.
    bool wait_for_maker(JobRecord& job);
    void resume_waiting(const std::shared_ptr<JobRecord>& job);
    /// Calls changed() for this job and for those that wait for its tables.
    void prepared_further(JobRecord& job);
    Status take_over_tables(JobRecord& job);
    void open_training(JobRecord& job, UnitKind kind, uint32_t round, const TrainingWork& work);
    void open_first_round(JobRecord& job);
    class Tracing;  ///< The TracingPort of one job.
    Status learn(JobRecord& job, std::stop_token stop);
    Status finish_tables(JobRecord& job, LearnedTables learned);
    bool adopt_cached_tables(JobRecord& job, const JobSpec& spec, const SceneFacts& facts);
    Status adopt_tables(JobRecord& job, const JobSpec& spec, const SceneFacts& facts, std::string_view bytes, TablesInfo tables);
    bool repair_tables(const std::string& job_id);
    void discard_training(JobRecord& job);
    void discard_round(JobRecord& job);
    /// Removes the asset of an ended job's tables unless another job needs it.
    void drop_tables(const Digest& digest);
    Status store_tables(const Digest& digest, std::string_view bytes);
    Status write_results(JobRecord& job);
    void forget_old_jobs();
    void finish_if_complete(JobRecord& job);
    /// Enters a result into its table. Returns nothing for a first result, which the caller merges, and otherwise the
    /// answer.
    std::optional<SubmitAck> repeated_result(JobRecord& job, UnitTable& units, const UnitKey& key, const WorkerRecord& worker,
                                             const Digest& digest);
    /// Counts an invalid result against its worker and its unit, which is rendered again; returns the answer.
    SubmitAck reject_result(JobRecord& job, UnitTable& units, const UnitKey& key, WorkerRecord& worker, const Status& why);
    void unit_failed(JobRecord& job, const UnitKey& key, UnitTable::Failures failures, const Status& why);
    void leases_expired(JobRecord& job, UnitTable& units, const std::vector<UnitTable::Expired>& expired);
    void tick(std::stop_token stop);
    std::optional<UnitLease> next_unit(WorkerRecord& worker);

    const CoordinatorOptions options_;
    AssetStore assets_;
    const TableCache table_cache_;
    std::mutex repair_mutex_;  ///< Must be locked before mutex_.
    /// Must be locked before mutex_. One preview is made at a time, because each takes the memory of several images.
    mutable std::mutex preview_mutex_;
    mutable std::mutex mutex_;
    mutable std::condition_variable work_changed_, job_changed_;
    std::vector<std::shared_ptr<JobRecord>> jobs_;  // oldest first
    std::vector<std::shared_ptr<void>> discarded_;  // large things that the ticker frees without the mutex
    std::map<std::string, JobRecord*> requests_;    // by request id
    WorkerRegistry workers_;
    bool closing_ = false;
    std::jthread ticker_;  // last, so that it stops before anything that it uses is destroyed
};

}  // namespace lightloom
