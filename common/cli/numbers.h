#pragma once
// Numbers on the command line. Every option of client, server and worker that is a number is checked by one of these, because CLI11
// alone takes NaN for a number of any range, reads a leading 0 as octal, wraps negative numbers around and lets large ones
// saturate.

#include <cstdint>

#include "common/cli/command_line.h"

namespace lightloom {

/// A real number of [low, high]; may have a plus sign.
cli::Check number_between(double low, double high);
/// A whole number of [low, high] in decimal, without sign or leading zeros.
cli::Check whole_number_between(uint64_t low, uint64_t high);
/// Any seed.
cli::Check whole_number();

}  // namespace lightloom
