#include "common/cli/start.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <thread>

#include "common/cli/log.h"
#include "common/cli/mistakes.h"
#include "common/core/crash_point.h"
#include "common/core/nearest.h"

namespace lightloom {

void add_log_option(CLI::App& app, std::string& level) {
    std::string known;
    for (const std::string_view name : kLogLevels)
        known += (known.empty() ? "" : name == kLogLevels[std::size(kLogLevels) - 1] ? " or " : ", ") + std::string(name);
    app.add_option("--log", level, "Least severe messages that are logged: " + known)
        ->type_name("LEVEL")
        ->capture_default_str()
        ->check([known](const std::string& text) {
            if (std::find(std::begin(kLogLevels), std::end(kLogLevels), text) != std::end(kLogLevels)) return std::string();
            return "\"" + text + "\" is not " + known + did_you_mean(text, kLogLevels);
        });
}

void add_version_option(CLI::App& app, const std::string& build) {
    app.set_version_flag("--version", app.get_name() + " " + build, "Print the program's name and build id, and exit");
}

int end_of_parse(const CLI::App& app, const CLI::ParseError& error) {
    if (!is_mistake(app, error)) return app.exit(error) == 0 ? kStopped : kBadCommandLine;
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), mistake_text(app, error).c_str());
    return kBadCommandLine;
}

std::optional<int> parse_and_log(CLI::App& app, int argc, char** argv, const std::string& level) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return end_of_parse(app, error);
    }
    set_up_background_logging(app.get_name(), level);
    ::signal(SIGPIPE, SIG_IGN);  // whoever reads the log may go away; a farm does not end with it
    if (const Status armed = arm_crash_point_of_environment(); !armed.ok()) {
        print_error(armed.message());
        return kBadCommandLine;
    }
    return std::nullopt;
}

int report_failure(const Status& status, const std::string& prefix) {
    print_error(prefix + status.message());
    return kFailedToRun;
}

uint32_t processor_count() { return std::max(1u, std::thread::hardware_concurrency()); }

StopSignals::StopSignals() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
}

void StopSignals::wait() const {
    int signal = 0;
    sigwait(&signals_, &signal);
}

void StopSignals::on_stop(std::function<void()> stop, int exit_code) const {
    std::thread([signals = *this, stop = std::move(stop), exit_code] {
        signals.wait();
        stop();
        signals.wait();
        flush_log(0.1);
        _exit(exit_code);
    }).detach();
}

}  // namespace lightloom
