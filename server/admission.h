#pragma once
// The desk for clients: jobs are accepted, cancelled, looked at and waited for, and their images handed out. See JobService for the
// errors.

#include "server/office.h"

namespace lightloom {

/// The spec with all that it leaves to defaults but what the scene decides.
Result<JobSpec> canonical_spec(const JobSpec& spec);

class Admission {
  public:
    explicit Admission(Office& office) : office_(office) {}

    Result<JobInfo> submit(const std::string& request_id, const JobSpec& spec, const JobLabel& label);
    Result<JobInfo> cancel(const std::string& job_id);
    Result<JobInfo> get(const std::string& job_id) const;
    std::vector<JobInfo> list() const;
    /// The job once its revision is above `after`, or as it is after `timeout_seconds`.
    Result<JobInfo> wait(const std::string& job_id, uint64_t after, double timeout_seconds) const;
    /// Returns once the job has ended, or after `timeout_seconds`.
    Status wait_end(const std::string& job_id, double timeout_seconds) const;
    Result<std::string> image(const std::string& job_id, ImageKind kind) const;
    Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure) const;
    Result<std::string> manifest(const std::string& job_id) const;

  private:
    /// Whether the scene's files are here; the path of the scene file among them.
    Result<std::string> check_assets(const JobSpec& spec) const;
    /// The answer to a request that was answered before, if it was.
    std::optional<Result<JobInfo>> repeated(JobBook& book, const std::string& request_id, const JobSpec& spec) const;
    /// The directory of a job that has succeeded; `what` is asked for.
    Result<std::filesystem::path> finished_directory(const std::string& job_id, const char* what) const;

    Office& office_;
    /// Held before the book is opened. One preview is made at a time, because each takes the memory of several images.
    mutable Mutex preview_mutex_;
    /// Held before the book is opened: one job is accepted at a time, so that a repeated request is answered only when the first
    /// one is on disk.
    Mutex submit_mutex_;
};

}  // namespace lightloom
