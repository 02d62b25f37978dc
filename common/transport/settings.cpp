#include "common/transport/settings.h"

#include <charconv>
#include <cmath>
#include <optional>

#include "common/core/check.h"
#include "common/core/nearest.h"
#include "common/path/path_view.h"

namespace lightloom {
namespace {

/// One number in the range of a parameter, or the name of a choice.
std::optional<double> parse_number(const ParameterInfo& p, std::string_view text) {
    double v = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
    bool number = error == std::errc() && end == text.data() + text.size() && std::isfinite(v);
    for (size_t c = 0; c < p.choices.size(); ++c) {
        if (p.choices[c] == text) v = double(c), number = true;
    }
    if (number && v >= p.min_value && v <= p.max_value && !(p.integer && v != std::floor(v))) return v;
    return std::nullopt;
}

/// Parses the value of a parameter; the error says what is wrong.
Result<ByDepth<double>> parse_value(const AlgorithmInfo& algorithm, const ParameterInfo& p, const std::string& text) {
    const size_t comma = p.by_depth ? text.find(',') : text.npos;
    const auto first = parse_number(p, std::string_view(text).substr(0, comma));
    const auto later = comma == text.npos ? first : parse_number(p, std::string_view(text).substr(comma + 1));
    if (first && later) return ByDepth<double>(*first, *later);
    return invalid_argument("parameter " + std::string(p.name) + "=" + text + " of '" + std::string(algorithm.name) + "' must be " +
                            p.range() + did_you_mean(text, p.choices));
}

/// The shortest text that parses to the same numbers; one number where both are equal.
std::string plain_text(const ByDepth<double>& value) {
    char text[128];
    char* end = std::to_chars(text, text + 64, value.at_first).ptr;
    if (value.later != value.at_first) {
        *end++ = ',';
        end = std::to_chars(end, text + sizeof text, value.later).ptr;
    }
    return std::string(text, end);
}

Status unknown_parameter(const AlgorithmInfo& algorithm, const std::string& name) {
    std::vector<std::string_view> known;
    for (const ParameterInfo& p : algorithm.parameters) known.push_back(p.name);
    const std::string owner(algorithm.name);
    for (const AbsentParameter& absent : algorithm.absent)
        if (absent.name == name)
            return invalid_argument("algorithm '" + owner + "' has no parameter '" + name + "': " + std::string(absent.reason));
    return invalid_argument("algorithm '" + owner + "' has no parameter '" + name + "'" + did_you_mean(name, known) +
                            "; `lightloom algorithms " + owner + "` lists them");
}

}  // namespace

AlgorithmSettings::AlgorithmSettings() : AlgorithmSettings(*catalog().front()) {}

AlgorithmSettings::AlgorithmSettings(const AlgorithmInfo& info) : info_(&info), chosen_(info.parameters.size(), false) {
    for (const ParameterInfo& p : info.parameters) values_.push_back(p.default_value);
}

Result<AlgorithmSettings> AlgorithmSettings::parse(std::string_view name, const std::map<std::string, std::string>& set) {
    const auto info = find_algorithm(name);
    if (!info.ok()) return invalid_argument(info.status().message());
    AlgorithmSettings settings(**info);
    for (const auto& [key, text] : set) {
        const size_t i = settings.index(key);
        if (i == settings.values_.size()) return unknown_parameter(**info, key);
        const auto value = parse_value(**info, (*info)->parameters[i], text);
        if (!value.ok()) return value.status();
        settings.values_[i] = *value;
        settings.chosen_[i] = true;
    }
    if ((*info)->check) LL_RETURN_IF_ERROR((*info)->check(settings));
    return settings;
}

size_t AlgorithmSettings::index(std::string_view parameter) const {
    size_t i = 0;
    while (i < info_->parameters.size() && info_->parameters[i].name != parameter) ++i;
    return i;
}

double AlgorithmSettings::value(std::string_view parameter) const {
    const ByDepth<double>& value = value_by_depth(parameter);
    LL_CHECK(!info_->parameters[index(parameter)].by_depth, "parameter '" + std::string(parameter) + "' may be two numbers");
    return value.at_first;
}

const ByDepth<double>& AlgorithmSettings::value_by_depth(std::string_view parameter) const {
    LL_CHECK(has(parameter), "algorithm '" + name() + "' has no parameter '" + std::string(parameter) + "'");
    return values_[index(parameter)];
}

bool AlgorithmSettings::chosen(std::string_view parameter) const { return has(parameter) && chosen_[index(parameter)]; }

AlgorithmSettings AlgorithmSettings::completed() const {
    AlgorithmSettings all = *this;
    all.chosen_.assign(all.chosen_.size(), true);
    return all;
}

AlgorithmSettings AlgorithmSettings::with(std::string_view parameter, const ByDepth<double>& value) const {
    AlgorithmSettings changed = *this;
    LL_CHECK(has(parameter), "algorithm '" + name() + "' has no parameter '" + std::string(parameter) + "'");
    const size_t i = index(parameter);
    const ParameterInfo& p = info_->parameters[i];
    LL_CHECK(p.by_depth || value.at_first == value.later, "parameter '" + std::string(parameter) + "' is one number");
    for (const double v : {value.at_first, value.later}) {
        LL_CHECK_GE(v, p.min_value);
        LL_CHECK_LE(v, p.max_value);
    }
    changed.values_[i] = value;
    changed.chosen_[i] = true;
    return changed;
}

std::map<std::string, std::string> AlgorithmSettings::text() const { return completed().chosen_text(); }

std::map<std::string, std::string> AlgorithmSettings::named_text() const { return completed().chosen_named_text(); }

std::map<std::string, std::string> AlgorithmSettings::chosen_text() const { return chosen_text(false); }

std::map<std::string, std::string> AlgorithmSettings::chosen_named_text() const { return chosen_text(true); }

std::map<std::string, std::string> AlgorithmSettings::chosen_text(bool named) const {
    std::map<std::string, std::string> out;
    for (size_t i = 0; i < values_.size(); ++i) {
        if (!chosen_[i]) continue;
        const ParameterInfo& p = info_->parameters[i];
        out[std::string(p.name)] = named ? p.text_of(values_[i]) : plain_text(values_[i]);
    }
    return out;
}

uint64_t AlgorithmSettings::light_paths_per_iteration(int64_t crop_pixels) const {
    const double paths = light_paths_per_pixel() * double(crop_pixels);
    return paths > 0 ? std::max<uint64_t>(1, uint64_t(std::llround(paths))) : 0;
}

Status check_depth(int max_depth) {
    if (max_depth >= 0 && max_depth + 1 <= kMaxEdges) return {};
    return invalid_argument("max depth must lie between 0 and " + std::to_string(kMaxEdges - 1) + ", not " +
                            std::to_string(max_depth));
}

}  // namespace lightloom
