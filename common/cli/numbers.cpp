#include "common/cli/numbers.h"

#include <charconv>
#include <cmath>

namespace lightloom {

cli::Check number_between(double low, double high) {
    const auto shortest = [](double value) {
        char text[32];
        return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
    };
    const std::string range = "from " + shortest(low) + " to " + shortest(high);
    return {[low, high, range](const std::string& text) {
                double value = NAN;
                const size_t sign = text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0;
                const auto [end, error] = std::from_chars(text.data() + sign, text.data() + text.size(), value);
                const bool good = error == std::errc() && end == text.data() + text.size() && value >= low && value <= high;
                return good ? std::string() : "\"" + text + "\" is no number " + range;
            },
            range};
}

cli::Check whole_number_between(uint64_t low, uint64_t high) {
    const std::string range = "from " + std::to_string(low) + " to " + std::to_string(high);
    return {[low, high, range](const std::string& text) {
                uint64_t value = 0;
                const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
                const bool decimal =
                    error == std::errc() && end == text.data() + text.size() && (text.size() == 1 || text[0] != '0');
                const bool good = decimal && value >= low && value <= high;
                return good ? std::string() : "\"" + text + "\" is no whole number " + range;
            },
            range};
}

double duration_seconds(const std::string& text) {
    double value = NAN;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const std::string unit(end, text.data() + text.size());
    if (error != std::errc()) return NAN;
    if (unit.empty() || unit == "s") return value;
    return unit == "m" ? 60 * value : unit == "h" ? 3600 * value : NAN;
}

cli::Check duration_between(double low, double high) {
    return {[low, high](const std::string& text) {
                const double seconds = duration_seconds(text);
                return seconds >= low && seconds <= high ? std::string() : "\"" + text + "\" is no time such as 90s, 40m or 1.5h";
            },
            "such as 90s, 40m or 1.5h"};
}

cli::Check whole_number() { return {whole_number_between(0, UINT64_MAX).find_fault, ""}; }

}  // namespace lightloom
