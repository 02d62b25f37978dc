#pragma once
// Settings of an algorithm from text, as a user would write them, and changes to them.

#include <map>
#include <stdexcept>
#include <string>

#include "common/transport/settings.h"

namespace lightloom::testing {

/// Throws the catalog's error if the settings are invalid.
inline AlgorithmSettings algorithm_of(const std::string& name, const std::map<std::string, std::string>& chosen = {}) {
    auto settings = AlgorithmSettings::parse(name, chosen);
    if (!settings.ok()) throw std::runtime_error(settings.status().message());
    return *std::move(settings);
}

/// The same settings with the default of this parameter.
inline AlgorithmSettings without(const AlgorithmSettings& settings, const std::string& parameter) {
    auto chosen = settings.chosen_text();
    chosen.erase(parameter);
    return algorithm_of(settings.name(), chosen);
}

}  // namespace lightloom::testing
