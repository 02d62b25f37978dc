// lightloom: the client.

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <memory>

#include "client/commands.h"
#include "common/cli/completion.h"
#include "common/cli/help.h"
#include "common/cli/log.h"
#include "common/cli/start.h"
#include "common/core/large_blocks.h"
#include "common/transport/catalog.h"
#include "common/work/identity.h"

namespace {

constexpr const char* kFooter = R"(First steps:
  lightloom render scene.pbrt --spp 16 --png quick.png        on this machine, no set-up
  lightloom algorithms                                        what --algorithm and --set take
  lightloom submit scene.pbrt --server HOST:PORT -o out.exr   on a service
  lightloom COMMAND --help                                    options and examples

Exit codes: 0 success; 1 the job failed, or the service does not know it; 2 bad command line or input file; 3 --strict
and non-finite samples were dropped; 4 the service could not be reached; 130 interrupted, or the job was cancelled.)";

/// What completion offers as values.
lightloom::OptionWords option_words() {
    lightloom::OptionWords words;
    for (const lightloom::AlgorithmInfo* algorithm : lightloom::catalog()) words["--algorithm"].emplace_back(algorithm->name);
    return words;
}

}  // namespace

int main(int argc, char** argv) {
    using namespace lightloom::client;
    lightloom::give_back_large_blocks();
    CLI::App app{"Lightloom: renders scenes whose light is hard to find, on one machine or many.", "lightloom"};
    app.formatter(std::make_shared<lightloom::HelpFormatter>());
    lightloom::add_version_option(app, lightloom::kBuildId);
    app.require_subcommand(1);
    lightloom::add_completion_option(app, option_words());
    std::string level = "warn";
    app.parse_complete_callback([&] { lightloom::set_up_logging("lightloom", level); });
    int exit_code = kSuccess;
    add_render_command(app, &exit_code);
    add_service_commands(app, &exit_code);
    add_inspect_command(app, &exit_code);
    add_compare_command(app, &exit_code);
    add_algorithms_command(app, &exit_code);
    add_replay_command(app, &exit_code);
    add_bench_command(app, &exit_code);
    add_reference_command(app, &exit_code);
    add_report_command(app, &exit_code);
    app.footer(kFooter);  // now, so that commands without one of their own do not show it
    // Before the command and behind it.
    lightloom::add_log_option(app, level);
    for (CLI::App* command : app.get_subcommands({})) lightloom::add_log_option(*command, level);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        exit_code = lightloom::end_of_parse(app, error);
    }
    // What was printed may be all that a command makes.
    std::fflush(stdout);
    std::cout.flush();
    if (!std::ferror(stdout) && std::cout) return exit_code;
    std::fprintf(stderr, "lightloom: standard output could not be written: %s\n", std::strerror(errno));
    return exit_code == kSuccess ? kFailure : exit_code;
}
