#pragma once
// Numbers for people, and the middle one of several.

#include <string>
#include <vector>

namespace lightloom::client {

/// The number as printf() writes it.
std::string formatted(const char* format, double value);

/// A run that ended with less than half of the iterations of the longest of its kind, because a budget cut it, is not compared with
/// that one: their errors are not those of two seeds.
inline bool much_shorter(double iterations, double longest) { return 2 * iterations < longest; }

/// The middle of the values in order, or the mean of the middle two; NaN of none.
double median(std::vector<double> values);

}  // namespace lightloom::client
