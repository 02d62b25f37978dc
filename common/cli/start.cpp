#include "common/cli/start.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <thread>

#include "common/cli/log.h"
#include "common/cli/log_line.h"

namespace lightloom {

void add_log_option(CLI::App& app, std::string& level) {
    app.add_option("--log", level, "trace, debug, info, warn, error or off")->capture_default_str();
}

std::optional<int> parse_and_log(CLI::App& app, int argc, char** argv, const std::string& level) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? kStopped : kBadCommandLine;
    }
    if (set_up_logging(app.get_name(), level)) return std::nullopt;
    std::cerr << "unknown log level \"" << level << "\"\n";
    return kBadCommandLine;
}

int log_failure(const Status& status, const std::string& prefix) {
    log_error("{}{}", prefix, status.message());
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
        _exit(exit_code);
    }).detach();
}

}  // namespace lightloom
