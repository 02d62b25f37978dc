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
    PreparePhase phase_ = PreparePhase::kReadingScene;
    bool shown_ = false;
    int last_percent_ = -10;
    std::chrono::steady_clock::time_point last_{};
};

/// "tables of 700 x 1000 subspaces from 200000 training samples, 2.1 s traced, 1.3 s learned".
std::string tables_line(const TablesInfo& tables);
/// "48 s", "3 min 05 s", "2 h 10 min".
std::string duration_text(double seconds);

}  // namespace lightloom::client
