#pragma once
// Progress of a job on standard error: one line that is redrawn on a terminal, plain lines otherwise: one per phase and tenth of
// the image, and whatever else is new after some seconds without a word, such as that no worker is there.

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

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
    using Clock = std::chrono::steady_clock;
    void break_silence(std::stop_token stop);
    void print_line();

    const bool quiet_, terminal_;
    std::mutex mutex_;
    std::condition_variable_any stopped_;
    bool open_ = false;
    JobState state_ = JobState::kPreparing;
    PreparePhase phase_ = PreparePhase::kReadingScene;
    bool shown_ = false;
    int last_percent_ = -10;
    std::string line_, printed_;  ///< What there is to say, and what was said last.
    Clock::time_point last_ = Clock::now();
    std::jthread silence_breaker_;  // last: stops before anything that it uses goes away
};

/// "tables of 700 x 1000 subspaces from 200000 training samples, 2.1 s traced, 1.3 s learned".
std::string tables_line(const TablesInfo& tables);
/// "relMSE 0.0123 +- 4 %", from the image's own groups.
std::string noise_text(const NoiseReport& noise);
/// "48 s", "3 min 05 s", "2 h 10 min".
std::string duration_text(double seconds);
/// The same, and from two days on "3 d 04 h".
std::string age_text(double seconds);

}  // namespace lightloom::client
