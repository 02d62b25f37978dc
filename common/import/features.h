#pragma once
// What a scene may hold that can be left out for a run, above all what the renderer does not support: the names that --without
// takes.

#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "common/import/parameters.h"

namespace lightloom {

/// One name of --without.
struct SceneFeature {
    std::string_view name;
    std::string_view meaning;  ///< What is left out, and what stands in for it.
};

const std::vector<SceneFeature>& scene_features();
/// "media, bump, ...": all names.
std::string scene_feature_names();
/// kInvalidArgument, which lists the names, for one that is none of them.
Status check_scene_features(const std::vector<std::string>& names);

namespace import {

/// How a feature shows in a directive with parameters.
struct FeatureRule {
    std::string_view feature;
    std::string_view word;       ///< Of the directive; "Material" stands for MakeNamedMaterial, too.
    std::string_view kind;       ///< Of it; empty: all.
    std::string_view parameter;  ///< What is left out; empty: the whole directive, unless `becomes` is another kind.
    std::string_view becomes;    ///< The kind that stands in.
    std::string_view keeps;      ///< Parameters that the stand-in takes over, separated by blanks.
    bool is_refused = true;      ///< Or it is supported, or whoever reads the parameter decides by its value.
};

/// The rules that apply to a directive, in the order of the table.
std::vector<const FeatureRule*> feature_rules(std::string_view word, std::string_view kind, const ParameterList& parameters);

/// Leaves out what the rule says. True if the whole directive is.
bool apply(const FeatureRule& rule, std::string* kind, ParameterList* parameters);

/// What a message about an unsupported feature ends with: "; remove it or render with --without NAME", or with another kind in
/// place of "remove it".
std::string how_to_leave_out(std::string_view feature, std::string_view instead = {});

}  // namespace import
}  // namespace lightloom
