#pragma once
// Logging set-up. Logs go to standard error so that standard output stays for results; see log_line.h.

#include <string>
#include <string_view>

namespace lightloom {

inline constexpr std::string_view kLogLevels[] = {"trace", "debug", "info", "warn", "error", "off"};

/// `level` is one of kLogLevels. Lines are written before the call that logs them returns.
void set_up_logging(const std::string& program, const std::string& level);

/// The same for a program that must not wait for the reader of its log: lines, and those of print_error(), are written by a thread.
/// Of more than some thousands that nobody has read, the oldest are dropped, and a line tells how many. Call it once.
/// Lines are flushed when the process exits or terminates, for a second at most.
void set_up_background_logging(const std::string& program, const std::string& level);

/// Waits for such lines to be written, `seconds` at most. Does nothing for a log without a thread.
void flush_log(double seconds);

/// "PROGRAM: message" on standard error, whatever the level. set_up_logging() has been told the program's name.
void print_error(const std::string& message);

}  // namespace lightloom
