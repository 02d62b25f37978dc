#pragma once
// Logging set-up. Logs go to standard error so that standard output stays for results; see log_line.h.

#include <string>
#include <string_view>

namespace lightloom {

inline constexpr std::string_view kLogLevels[] = {"trace", "debug", "info", "warn", "error", "off"};

/// `level` is one of kLogLevels.
void set_up_logging(const std::string& program, const std::string& level);

/// "PROGRAM: message" on standard error, whatever the level. set_up_logging() has been told the program's name.
void print_error(const std::string& message);

}  // namespace lightloom
