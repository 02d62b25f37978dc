#pragma once
// Logging set-up. Logs go to standard error so that standard output stays for results; see log_line.h.

#include <string>

namespace lightloom {

/// `level`: trace, debug, info, warn, error or off. Returns false for an unknown level.
bool set_up_logging(const std::string& program, const std::string& level);

}  // namespace lightloom
