#pragma once
// Lines on their way to a log that may be blocked: whoever logs never waits for whoever reads.

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace lightloom {

/// A bounded queue of lines, written by a thread of its own. When it is full the oldest line goes, and one line tells how many
/// went. Safe for any number of threads.
class LogQueue {
  public:
    /// Writes bytes, and may block for as long as it likes. Called by one thread.
    using Write = std::function<void(std::string_view bytes)>;

    /// `program` begins the line that tells of lost ones. `capacity`: lines, at least 1.
    LogQueue(std::string program, size_t capacity, Write write);
    /// Waits for nothing: a writer that is blocked stays behind, with what it needs.
    ~LogQueue();
    LogQueue(const LogQueue&) = delete;

    /// `line` ends with a newline.
    void push(std::string line);
    /// Waits until all that was pushed is written, but `seconds` at most. False: it is not.
    bool flush(double seconds);

  private:
    struct State;
    std::shared_ptr<State> state_;
};

/// Writes all of `bytes` to a file descriptor, and gives up where that fails: a log that nobody can read is no reason to end.
void write_log_bytes(int file, std::string_view bytes);

}  // namespace lightloom
