#pragma once
// The commands of the `lightloom` program, one file each. A command adds itself to the application; its callback stores the
// process's exit code.

#include "common/cli/command_line.h"

namespace lightloom::client {

/// Documented in client/README.md and in `lightloom --help`.
enum ExitCode : int {
    kSuccess = 0,
    kFailure = 1,         ///< The job or the comparison failed, or the service does not know the job.
    kUsage = 2,           ///< Bad command line or bad input file.
    kDroppedSamples = 3,  ///< --strict, and non-finite samples were dropped.
    kUnavailable = 4,     ///< The service could not be reached.
    kCancelled = 130,
};

void add_render_command(cli::App app, int* exit_code);    // render, embedded
void add_service_commands(cli::App app, int* exit_code);  // submit, watch, fetch, cancel, finish, list, workers, preview
void add_inspect_command(cli::App app, int* exit_code);
void add_compare_command(cli::App app, int* exit_code);
void add_algorithms_command(cli::App app, int* exit_code);
void add_replay_command(cli::App app, int* exit_code);
void add_bench_command(cli::App app, int* exit_code);
void add_reference_command(cli::App app, int* exit_code);
void add_report_command(cli::App app, int* exit_code);

}  // namespace lightloom::client
