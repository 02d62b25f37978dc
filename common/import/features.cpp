#include "common/import/features.h"

#include <algorithm>

namespace lightloom {
namespace {

const std::vector<SceneFeature> kFeatures{
    {"media", "participating media: MediumInterface, and media between the layers of coated materials"},
    {"bump", "bump and normal maps: the materials' displacement and normalmap"},
    {"displacement", "displacement of a plymesh's geometry"},
    {"curves", "shapes \"curve\""},
    {"hair", "materials \"hair\", which become diffuse with their reflectance (0.5 where they have none)"},
    {"subsurface", "materials \"subsurface\", which become coateddiffuse with their reflectance (0.5), roughness and eta (1.33)"},
    {"measured", "materials \"measured\", which become diffuse with reflectance 0.5"},
    {"motion", "motion: everything stands where ActiveTransform StartTime puts it"},
    {"portals", "portals of infinite lights"},
    {"spectral", "what the film \"spectral\" stores besides colour"},
    {"ptex", "textures \"ptex\", which become 0.5"},
    {"options", "the Options disablepixeljitter, forcediffuse and pixelstats"},
};

}  // namespace

const std::vector<SceneFeature>& scene_features() { return kFeatures; }

std::string scene_feature_names() {
    std::string out;
    for (const SceneFeature& f : kFeatures) out.append(out.empty() ? "" : ", ").append(f.name);
    return out;
}

Status check_scene_features(const std::vector<std::string>& names) {
    for (const std::string& name : names)
        if (std::none_of(kFeatures.begin(), kFeatures.end(), [&](const SceneFeature& f) { return f.name == name; }))
            return invalid_argument(import::quoted(name) + " is unknown; --without takes " + scene_feature_names());
    return {};
}

namespace import {
namespace {

constexpr FeatureRule kRules[] = {
    {"hair", "Material", "hair", "", "diffuse", "type reflectance displacement normalmap"},
    {"subsurface", "Material", "subsurface", "", "coateddiffuse",
     "type reflectance roughness uroughness vroughness remaproughness eta displacement normalmap"},
    {"measured", "Material", "measured", "", "diffuse", "type displacement normalmap"},
    {"bump", "Material", "", "displacement", "", "", false},
    {"bump", "Material", "", "normalmap", "", "", false},
    {"media", "Material", "coateddiffuse", "albedo", "", "", false},
    {"media", "Material", "coateddiffuse", "g", "", "", false},
    {"media", "Material", "coatedconductor", "albedo", "", "", false},
    {"media", "Material", "coatedconductor", "g", "", "", false},
    {"displacement", "Shape", "plymesh", "displacement", "", ""},
    {"curves", "Shape", "curve", "", "", ""},
    {"portals", "LightSource", "infinite", "portal", "", ""},
    {"spectral", "Film", "spectral", "", "rgb",
     "xresolution yresolution cropwindow pixelbounds filename diagonal iso exposuretime sensor whitebalance maxcomponentvalue "
     "savefp16"},
    {"ptex", "Texture", "ptex", "", "constant", ""},
};

}  // namespace

std::vector<const FeatureRule*> feature_rules(std::string_view word, std::string_view kind, const ParameterList& parameters) {
    std::vector<const FeatureRule*> out;
    for (const FeatureRule& rule : kRules)
        if (rule.word == word && (rule.kind.empty() || rule.kind == kind) &&
            (rule.parameter.empty() || parameters.peek(rule.parameter)))
            out.push_back(&rule);
    return out;
}

bool apply(const FeatureRule& rule, std::string* kind, ParameterList* parameters) {
    if (!rule.parameter.empty()) {
        parameters->remove(rule.parameter);
        return false;
    }
    if (rule.becomes.empty()) return true;
    parameters->keep_only(rule.keeps);
    if (*kind == "subsurface") parameters->add_default("float", "eta", {1.33});
    *kind = rule.becomes;
    return false;
}

std::string how_to_leave_out(std::string_view feature, std::string_view instead) {
    return (instead.empty() ? "; remove it" : "; use \"" + std::string(instead) + "\"") + " or render with --without " +
           std::string(feature);
}

}  // namespace import
}  // namespace lightloom
