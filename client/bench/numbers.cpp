#include "client/bench/numbers.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>

namespace lightloom::client {

std::string formatted(const char* format, double value) {
    char text[64];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

double median(std::vector<double> values) {
    if (values.empty()) return std::nan("");
    const size_t half = values.size() / 2;
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(half), values.end());
    const double upper = values[half];
    if (values.size() % 2 == 1) return upper;
    return (*std::max_element(values.begin(), values.begin() + std::ptrdiff_t(half)) + upper) / 2;
}

}  // namespace lightloom::client
