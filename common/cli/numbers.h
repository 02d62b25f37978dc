#pragma once
// Numbers on the command line. Every option of client, server and worker that is a number is checked by one of these, because CLI11
// alone takes NaN for a number of any range, reads a leading 0 as octal, wraps negative numbers around and lets large ones
// saturate.

#include <cstdint>
#include <string>

#include "common/cli/command_line.h"

namespace lightloom {

/// A real number of [low, high]; may have a plus sign.
cli::Check number_between(double low, double high);
/// A whole number of [low, high] in decimal, without sign or leading zeros.
cli::Check whole_number_between(uint64_t low, uint64_t high);
/// A time of [low, high] seconds: a number with s, m or h behind it, or nothing for seconds.
cli::Check duration_between(double low, double high);
/// Its seconds; NaN for anything else.
double duration_seconds(const std::string& text);
/// Any seed.
cli::Check whole_number();

}  // namespace lightloom
