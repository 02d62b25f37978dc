#pragma once
// The desk for clients: jobs are accepted, looked at and waited for. See JobService for the errors.

#include "server/office.h"

namespace lightloom {

/// The spec with all that it leaves to defaults but what the scene decides.
Result<JobSpec> canonical_spec(const JobSpec& spec);

/// What submissions have in common that can have the same answer; nothing for one that never can, because it has a time limit.
/// Beside the spec it takes the same build.
std::optional<Digest> reuse_key(const JobSpec& submitted);

class Admission {
  public:
    explicit Admission(Office& office) : office_(office) {}

    Result<JobInfo> submit(const std::string& request_id, const JobSpec& spec, const JobLabel& label, Reuse reuse);
    Result<JobInfo> get(const std::string& job_id) const;
    std::vector<JobInfo> list() const;
    /// The job once its revision is above `after`, or as it is after `timeout_seconds`.
    Result<JobInfo> wait(const std::string& job_id, uint64_t after, double timeout_seconds) const;
    /// Returns once the job has ended, or after `timeout_seconds`.
    Status wait_end(const std::string& job_id, double timeout_seconds) const;

  private:
    /// Whether the scene's files are here; the path of the scene file among them.
    Result<std::string> check_assets(const JobSpec& spec) const;
    /// The answer to a request that was answered before, if it was.
    std::optional<Result<JobInfo>> repeated(JobBook& book, const std::string& request_id, const JobSpec& spec) const;
    /// The job that answers a submission with this key, if its image is still there and sound, or it is under way.
    std::optional<JobInfo> same_job(const Digest& key) const;

    Office& office_;
    /// Held before the book is opened: one job is accepted at a time, so that a repeated request is answered only when the first
    /// one is on disk.
    Mutex submit_mutex_;
};

}  // namespace lightloom
