#pragma once
// Checks of options that CLI11 leaves open.

#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace lightloom::client {

/// CLI::Range, which takes NaN for a number of any range.
inline CLI::Validator number_between(double low, double high) {
    const CLI::Range range(low, high);
    return CLI::Validator(
        [range](std::string& text) {
            return std::isnan(std::strtod(text.c_str(), nullptr)) ? "\"" + text + "\" is not a number" : range(text);
        },
        range.get_description());
}

/// A whole number from 0 to 2^64 - 1 in decimal: CLI11 wraps signs around, saturates, and reads a leading 0 as octal.
inline CLI::Validator whole_number() {
    return CLI::Validator(
        [](std::string& text) {
            uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool good = error == std::errc() && end == text.data() + text.size() && (text.size() == 1 || text[0] != '0');
            return good ? std::string() : "\"" + text + "\" is no whole number from 0 to 18446744073709551615";
        },
        "");
}

}  // namespace lightloom::client
