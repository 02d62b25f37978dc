#pragma once
// Numbers for people, and the middle one of several.

#include <string>
#include <vector>

namespace lightloom::client {

/// The number as printf() writes it.
std::string formatted(const char* format, double value);

/// The middle of the values in order, or the mean of the middle two; NaN of none.
double median(std::vector<double> values);

}  // namespace lightloom::client
