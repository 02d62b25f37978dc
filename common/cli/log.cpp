#include "common/cli/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <cstdio>

namespace lightloom {

void set_up_logging(const std::string& program, const std::string& level) {
    auto logger = std::make_shared<spdlog::logger>(program, std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e %n %^%l%$ %v");
    logger->set_level(spdlog::level::from_str(level));
    spdlog::set_default_logger(logger);
}

void print_error(const std::string& message) {
    std::fprintf(stderr, "%s: %s\n", spdlog::default_logger()->name().c_str(), message.c_str());
}

}  // namespace lightloom
