#pragma once
// Progress of a job on standard error: one line that is redrawn on a terminal, plain lines otherwise.

#include <chrono>

#include "common/work/service.h"

namespace lightloom::client {

class Progress {
  public:
    explicit Progress(bool quiet);
    ~Progress();
    void show(const JobInfo& job);
    /// Ends a line that is being redrawn.
    void finish();

  private:
    bool quiet_, terminal_, open_ = false;
    JobState state_ = JobState::kPreparing;
    bool shown_ = false;
    int last_percent_ = -10;
    std::chrono::steady_clock::time_point last_{};
};

/// "48 s", "3 min 05 s", "2 h 10 min".
std::string duration_text(double seconds);

}  // namespace lightloom::client
