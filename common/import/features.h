#pragma once
// Features of a scene that can be left out of a rendering, above all those that the renderer does not support: the
// names that --without takes.

#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "common/import/parameters.h"

namespace lightloom {

/// One name of --without.
struct SceneFeature {
    std::string_view name;
    std::string_view meaning;  ///< What is left out, and what replaces it.
};

const std::vector<SceneFeature>& scene_features();
/// All names, as "media, bump, ...".
std::string scene_feature_names();
/// kInvalidArgument, listing the names, if one of `names` is unknown.
Status check_scene_features(const std::vector<std::string>& names);

namespace import {

/// How a feature appears in a directive with parameters.
struct FeatureRule {
    std::string_view feature;
    std::string_view word;       ///< Word of the directive; "Material" stands for MakeNamedMaterial, too.
    std::string_view kind;       ///< Kind of the directive; empty: every kind.
    std::string_view parameter;  ///< What is left out; empty: the whole directive, unless `becomes` is another kind.
    std::string_view becomes;    ///< The kind that replaces it.
    std::string_view keeps;      ///< Parameters that the replacement takes over, separated by blanks.
    bool is_refused = true;      ///< False if it is supported or the parameter's reader decides by the value.
};

/// The rules that apply to a directive, in the order of the table.
std::vector<const FeatureRule*> feature_rules(std::string_view word, std::string_view kind, const ParameterList& parameters);

/// Leaves out what the rule says. True if the whole directive is left out.
bool apply(const FeatureRule& rule, std::string* kind, ParameterList* parameters);

/// What a message about an unsupported feature ends with: "; remove it or render with --without NAME", or with another kind in
/// place of "remove it".
std::string how_to_leave_out(std::string_view feature, std::string_view instead = {});

}  // namespace import
}  // namespace lightloom
