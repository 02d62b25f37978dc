#pragma once
// The desk where clients end jobs: at once, or with the next complete group. See JobService for the errors.

#include "server/office.h"

namespace lightloom {

class EndEarly {
  public:
    explicit EndEarly(Office& office) : office_(office) {}

    Result<JobInfo> cancel(const std::string& job_id, OnCancel what);
    Result<JobInfo> finish(const std::string& job_id);

  private:
    /// That a decision about the job is on disk; a job that has ended meanwhile needs none.
    Status written_down(const std::string& job_id, const Status& status, const char* decision);

    /// That the job is cancelled is on disk.
    Status put_down_end(const std::string& job_id, const JobInfo& info);

    Office& office_;
};

}  // namespace lightloom
