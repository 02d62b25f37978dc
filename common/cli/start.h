#pragma once
// How the programs start and stop: the command line, the log, threads and signals.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <signal.h>

#include "common/core/result.h"

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace lightloom {

/// Exit codes of the programs that run until they are asked to stop.
inline constexpr int kStopped = 0, kFailedToRun = 1, kBadCommandLine = 2;

/// --log, of a program or of one of its commands.
void add_log_option(CLI::App& app, std::string& level);
/// --version: "PROGRAM BUILD", the same for every program.
void add_version_option(CLI::App& app, const std::string& build);
/// What is to be done when parse() has thrown: prints help or the version, or the mistake as one line "PROGRAM: message" on
/// standard error. kStopped or kBadCommandLine.
int end_of_parse(const CLI::App& app, const CLI::ParseError& error);
/// Parses the command line of such a program, sets up its log at `level`, which an option may set and whose reader may go away or
/// stop reading, and arms the crash point that the environment names. An exit code where the program is to end now: after --help,
/// and after a mistake, which was printed.
std::optional<int> parse_and_log(CLI::App& app, int argc, char** argv, const std::string& level);
/// print_error(), behind `prefix`; the exit code of a program that it ends.
int report_failure(const Status& status, const std::string& prefix = "");

/// At least 1.
uint32_t processor_count();

/// SIGINT and SIGTERM, which no thread takes but one that waits here: they are blocked in this thread and in all those that it
/// makes afterwards, so an object is made before the others are.
class StopSignals {
  public:
    StopSignals();
    /// Until one arrives.
    void wait() const;
    /// Has a thread of its own wait: the first signal calls `stop` there, the second one ends the process at once with `exit_code`.
    /// The thread outlives this object, and main.
    void on_stop(std::function<void()> stop, int exit_code) const;

  private:
    sigset_t signals_;
};

}  // namespace lightloom
