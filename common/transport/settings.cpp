#include "common/transport/settings.h"

#include <charconv>
#include <cmath>

#include "common/core/check.h"
#include "common/core/nearest.h"
#include "common/path/path_view.h"

namespace lightloom {
namespace {

/// Parses the value of a parameter; the error says what is wrong.
Result<double> parse_value(const AlgorithmInfo& algorithm, const ParameterInfo& p, const std::string& text) {
    double v = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
    bool number = error == std::errc() && end == text.data() + text.size() && std::isfinite(v);
    for (size_t c = 0; c < p.choices.size(); ++c) {
        if (p.choices[c] == text) v = double(c), number = true;
    }
    if (number && v >= p.min_value && v <= p.max_value && !(p.integer && v != std::floor(v))) return v;
    return invalid_argument("parameter " + std::string(p.name) + "=" + text + " of '" + std::string(algorithm.name) + "' must be " +
                            p.range() + did_you_mean(text, p.choices));
}

Status unknown_parameter(const AlgorithmInfo& algorithm, const std::string& name) {
    std::vector<std::string_view> known;
    for (const ParameterInfo& p : algorithm.parameters) known.push_back(p.name);
    const std::string owner(algorithm.name);
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
    return settings;
}

size_t AlgorithmSettings::index(std::string_view parameter) const {
    size_t i = 0;
    while (i < info_->parameters.size() && info_->parameters[i].name != parameter) ++i;
    return i;
}

double AlgorithmSettings::value(std::string_view parameter) const {
    LL_CHECK(has(parameter), "algorithm '" + name() + "' has no parameter '" + std::string(parameter) + "'");
    return values_[index(parameter)];
}

bool AlgorithmSettings::chosen(std::string_view parameter) const { return has(parameter) && chosen_[index(parameter)]; }

AlgorithmSettings AlgorithmSettings::completed() const {
    AlgorithmSettings all = *this;
    all.chosen_.assign(all.chosen_.size(), true);
    return all;
}

AlgorithmSettings AlgorithmSettings::with(std::string_view parameter, double value) const {
    AlgorithmSettings changed = *this;
    LL_CHECK(has(parameter), "algorithm '" + name() + "' has no parameter '" + std::string(parameter) + "'");
    const size_t i = index(parameter);
    LL_CHECK_GE(value, info_->parameters[i].min_value);
    LL_CHECK_LE(value, info_->parameters[i].max_value);
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
        if (named) {
            out[std::string(info_->parameters[i].name)] = info_->parameters[i].text_of(values_[i]);
            continue;
        }
        char text[64];
        const auto end = std::to_chars(text, text + sizeof text, values_[i]).ptr;
        out[std::string(info_->parameters[i].name)] = std::string(text, end);
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
