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

cli::Check whole_number() { return {whole_number_between(0, UINT64_MAX).find_fault, ""}; }

}  // namespace lightloom
