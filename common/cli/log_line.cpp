#include "common/cli/log_line.h"

#include <fmt/args.h>
#include <spdlog/spdlog.h>

#include "common/core/utf8.h"

namespace lightloom {

namespace {

/// Texts come from whoever calls, such as the name of a worker's host: none may look like a line of ours, or steer a terminal.
std::string shown(std::string_view text) { return is_one_line(text) ? std::string(text) : one_line(text); }
auto shown(auto number) { return number; }

}  // namespace

void log_line(LogLevel level, std::string_view format, std::initializer_list<LogValue> values) {
    const auto severity = level == LogLevel::kDebug  ? spdlog::level::debug
                          : level == LogLevel::kInfo ? spdlog::level::info
                          : level == LogLevel::kWarn ? spdlog::level::warn
                                                     : spdlog::level::err;
    if (!spdlog::should_log(severity)) return;
    fmt::dynamic_format_arg_store<fmt::format_context> store;
    for (const LogValue& value : values) std::visit([&](const auto& held) { store.push_back(shown(held)); }, value.value());
    spdlog::log(severity, spdlog::string_view_t(fmt::vformat({format.data(), format.size()}, store)));
}

}  // namespace lightloom
