#include "common/transport/catalog.h"

#include <charconv>

#include "common/core/nearest.h"

namespace lightloom {

// Each is defined in the algorithm's own file.
extern const AlgorithmInfo kPathRow, kLightRow, kBdptRow, kLvcbptRow, kSpcbptRow, kVcmRow;

namespace {

std::vector<const AlgorithmInfo*>& rows() {
    static std::vector<const AlgorithmInfo*> rows{&kPathRow, &kLightRow, &kBdptRow, &kLvcbptRow, &kSpcbptRow, &kVcmRow};
    return rows;
}

/// As people write it: 500000 and not 5e+05.
std::string number_text(double value, bool integer) {
    char text[64];
    const auto end =
        integer ? std::to_chars(text, text + sizeof text, int64_t(value)) : std::to_chars(text, text + sizeof text, value);
    return std::string(text, end.ptr);
}

}  // namespace

std::string ParameterInfo::text_of(const ByDepth<double>& value) const {
    if (!choices.empty()) return std::string(choices[size_t(value.at_first)]);
    const std::string first = number_text(value.at_first, integer);
    return value.later == value.at_first ? first : first + "," + number_text(value.later, integer);
}

std::string ParameterInfo::range() const {
    if (choices.empty()) {
        return std::string(integer ? "an integer" : "a number") + " from " + number_text(min_value, integer) + " to " +
               number_text(max_value, integer) +
               (by_depth ? ", or two with a comma between them: at the camera's first hit, at later ones" : "");
    }
    std::string names;
    for (size_t c = 0; c < choices.size(); ++c) {
        const bool last = c + 1 == choices.size();
        names += (c == 0 ? "" : last ? " or " : ", ") + std::string(choices[c]);
    }
    return names;
}

std::span<const AlgorithmInfo* const> catalog() { return rows(); }

Result<const AlgorithmInfo*> find_algorithm(std::string_view name) {
    std::string known;
    std::vector<std::string_view> names;
    for (const AlgorithmInfo* a : catalog()) {
        if (a->name == name) return a;
        known += (known.empty() ? "" : ", ") + std::string(a->name);
        names.push_back(a->name);
    }
    return not_found("no algorithm named '" + std::string(name) + "'" + did_you_mean(name, names) + "; choose one of: " + known);
}

void add_to_catalog(const AlgorithmInfo& row) { rows().push_back(&row); }

}  // namespace lightloom
