#pragma once
// Numbers on the command line. Every option of client, server and worker that is a number is checked by one of these, because CLI11
// alone takes NaN for a number of any range, reads a leading 0 as octal, wraps negative numbers around and lets large ones
// saturate.

#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

namespace lightloom {

/// A real number of [low, high]; may have a plus sign.
inline CLI::Validator number_between(double low, double high) {
    const auto shortest = [](double value) {
        char text[32];
        return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
    };
    const std::string range = "from " + shortest(low) + " to " + shortest(high);
    return CLI::Validator(
        [low, high, range](std::string& text) {
            double value = NAN;
            const size_t sign = text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0;
            const auto [end, error] = std::from_chars(text.data() + sign, text.data() + text.size(), value);
            const bool good = error == std::errc() && end == text.data() + text.size() && value >= low && value <= high;
            return good ? std::string() : "\"" + text + "\" is no number " + range;
        },
        range);
}

/// A whole number of [low, high] in decimal, without sign or leading zeros.
inline CLI::Validator whole_number_between(uint64_t low, uint64_t high) {
    const std::string range = "from " + std::to_string(low) + " to " + std::to_string(high);
    return CLI::Validator(
        [low, high, range](std::string& text) {
            uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool decimal = error == std::errc() && end == text.data() + text.size() && (text.size() == 1 || text[0] != '0');
            const bool good = decimal && value >= low && value <= high;
            return good ? std::string() : "\"" + text + "\" is no whole number " + range;
        },
        range);
}

/// Any seed.
inline CLI::Validator whole_number() { return whole_number_between(0, UINT64_MAX).description(""); }

}  // namespace lightloom
