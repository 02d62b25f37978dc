// Directives that describe the scene's content; parser.cpp has those that only change the graphics state.

#include <algorithm>
#include <array>
#include <cmath>

#include "common/import/parser.h"
#include "common/import/tessellate.h"

namespace lightloom::import {
namespace {

constexpr std::string_view kAreaLightParameters[] = {"rgb L",       "blackbody L",   "spectrum L",     "float scale",
                                                     "float power", "bool twosided", "string filename"};

std::string read_name(Tokenizer* tokens, const Location& where, const std::string& word) {
    const Token token = tokens->next();
    if (token.kind != TokenKind::kString) fail(where, word + " needs a quoted name");
    return std::string(token.text);
}

/// Whether the transformation changes lengths by as much as pbrt-v4 warns of.
bool has_scale(const Mat4& m) {
    const std::optional<double> scale = similarity_scale(m);
    return !scale || !(std::fabs(*scale * *scale - 1) <= 1e-3);
}

/// Reads an Option's value: a word, a string or a number.
std::string read_value(Tokenizer* tokens, const Location& where) {
    const bool bracketed = tokens->peek().kind == TokenKind::kOpen;
    if (bracketed) tokens->next();
    const Token token = tokens->next();
    if (token.kind != TokenKind::kWord && token.kind != TokenKind::kString) fail(where, "Option needs a value");
    const std::string value(token.text);
    if (bracketed && tokens->next().kind != TokenKind::kClose) fail(where, "Option needs exactly one value");
    return value;
}

}  // namespace

void Parser::option(Tokenizer* tokens, const Location& where) {
    const std::string declaration = read_name(tokens, where, "Option");
    const std::string value = read_value(tokens, where);
    const size_t space = declaration.find(' ');
    const std::string name = space == std::string::npos ? declaration : declaration.substr(space + 1);
    const std::string shown = "Option " + quoted(declaration);
    // These options affect how pbrt computes, writes or displays, but not what the picture converges to.
    constexpr std::array<std::string_view, 8> kHarmless{"seed",
                                                        "rendercoordsys",
                                                        "msereferenceimage",
                                                        "msereferenceout",
                                                        "disablewavelengthjitter",
                                                        "displacementedgescale",
                                                        "disabletexturefiltering",
                                                        "wavefront"};
    if (std::find(kHarmless.begin(), kHarmless.end(), name) != kHarmless.end()) {
        context_->diagnostics.warn(where, shown + " is ignored: it does not change what the picture converges to");
    } else if (name == "disablepixeljitter" || name == "forcediffuse" || name == "pixelstats") {
        if (value != "false") context_->unsupported(where, "options", shown);
    } else {
        fail(where, "unknown " + shown + "; remove it or correct its name");
    }
}

bool Parser::global_option(Tokenizer* tokens, const std::string& word, const Location& where) {
    constexpr std::array<std::string_view, 6> kWords{"Camera", "Film", "PixelFilter", "Sampler", "Integrator", "Accelerator"};
    if (std::find(kWords.begin(), kWords.end(), word) == kWords.end()) return false;
    require_world(where, word, false);
    std::string kind = read_name(tokens, where, word);
    ParameterList list = parameters(tokens, where, word, kind, "");
    if (leave_out(word, &kind, &list)) return true;
    if (word == "Camera") {
        const Mat4 camera_to_world = *inverse(static_transform(where, "the camera"));
        set_camera(context_, kind, list, camera_to_world);
        coordinate_systems_["camera"] = {{camera_to_world, camera_to_world}, {}};
    } else if (word == "Film") {
        set_film(context_, kind, list);
    } else if (word == "PixelFilter") {
        set_pixel_filter(context_, kind, list);
    } else if (word == "Sampler") {
        set_sampler(context_, kind, list);
    } else if (word == "Integrator") {
        set_integrator(context_, kind, list);
    } else {
        context_->diagnostics.warn(where, "Accelerator " + quoted(kind) + " is ignored: the renderer builds its own");
        return true;
    }
    list.finish();
    return true;
}

bool Parser::world_item(Tokenizer* tokens, const std::string& word, const Location& where) {
    if (word == "Shape") {
        shape(tokens, where);
    } else if (word == "Texture") {
        texture(tokens, where);
    } else if (word == "Material") {
        std::string kind = read_name(tokens, where, word);
        ParameterList list = parameters(tokens, where, word, kind, "material");
        leave_out(word, &kind, &list);
        context_->anonymous_materials.push_back({kind, std::move(list)});
        state_.material = {false, "", int(context_->anonymous_materials.size()) - 1, where};
    } else if (word == "MakeNamedMaterial") {
        const std::string name = read_name(tokens, where, word);
        ParameterList list = parameters(tokens, where, word, name, "material");
        std::string kind = list.one_string("type", "");
        if (kind.empty()) fail(where, list.what() + " has no \"string type\"");
        note_old_syntax(where, "Material", kind, list);
        leave_out("Material", &kind, &list);
        if (!context_->named_materials.try_emplace(name, Definition{kind, std::move(list)}).second)
            fail(where, "the material " + quoted(name) + " is defined twice; rename one of the two");
    } else if (word == "NamedMaterial") {
        state_.material = {true, read_name(tokens, where, word), 0, where};
    } else if (word == "LightSource") {
        require_world(where, word, true);
        std::string kind = read_name(tokens, where, word);
        ParameterList list = parameters(tokens, where, word, kind, "light");
        if (leave_out(word, &kind, &list)) return true;
        add_light(context_, kind, list, static_transform(where, "the light"));
        list.finish();
    } else if (word == "AreaLightSource") {
        require_world(where, word, true);
        const std::string kind = read_name(tokens, where, word);
        note_old_syntax(where, word, kind, {});
        if (kind != "diffuse") fail(where, "AreaLightSource " + quoted(kind) + " is not supported; the only kind is \"diffuse\"");
        ParameterList list = parameters(tokens, where, word, kind, "light");
        // This is checked now and not when a shape emits, because there may be no such shape.
        list.check(kAreaLightParameters);
        state_.area_light = std::make_shared<AreaLightDefinition>(AreaLightDefinition{std::move(list)});
    } else if (word == "ObjectInstance") {
        object_instance(tokens, where);
    } else if (word == "MakeNamedMedium") {
        const std::string name = read_name(tokens, where, word);
        ParameterList::parse(tokens, where, word);
        media_[name] = true;
        context_->diagnostics.warn(where, "the medium " + quoted(name) + " is ignored as long as nothing uses it");
    } else if (word == "MediumInterface") {
        medium_interface(tokens, where);
    } else {
        return false;
    }
    return true;
}

void Parser::medium_interface(Tokenizer* tokens, const Location& where) {
    const std::string inside = read_name(tokens, where, "MediumInterface");
    std::string outside = inside;
    if (tokens->peek().kind == TokenKind::kString) outside = read_name(tokens, where, "MediumInterface");
    if (!inside.empty() || !outside.empty())
        context_->unsupported(where, "media",
                              "MediumInterface " + quoted(inside) + " " + quoted(outside) + " (participating media)");
}

void Parser::texture(Tokenizer* tokens, const Location& where) {
    require_world(where, "Texture", true);
    const std::string name = read_name(tokens, where, "Texture");
    const std::string type = read_name(tokens, where, "Texture");
    std::string kind = read_name(tokens, where, "Texture");
    note_old_syntax(where, "Texture", type, {});
    if (type != "float" && type != "spectrum")
        fail(where, "Texture " + quoted(name) + " has the type " + quoted(type) + "; it must be float or spectrum");
    ParameterList list(where, "Texture " + quoted(name) + " of kind " + quoted(kind));
    const bool good = context_->diagnostics.guard([&] { list = ParameterList::parse(tokens, where, list.what()); });
    if (!good) {  // The texture exists all the same, so that references to it are no further faults.
        skip_to_directive(tokens);
        kind = "constant";
    }
    list.report_to(&context_->diagnostics);
    const bool was_ptex = kind == "ptex";
    leave_out("Texture", &kind, &list);
    if (was_ptex && type == "float") list.add_default("float", "value", {0.5});
    if (was_ptex && type == "spectrum") list.add_default("rgb", "value", {0.5, 0.5, 0.5});
    if (const auto it = state_.attributes.find("texture"); it != state_.attributes.end()) list.add_defaults(it->second);
    auto& table = type == "float" ? context_->float_textures : context_->spectrum_textures;
    const bool moves = !(state_.ctm[0] == state_.ctm[1]) && !context_->leaves_out(where, "motion");
    Definition definition{kind, std::move(list), state_.ctm[0], moves};
    if (!table.try_emplace(name, std::move(definition)).second)
        fail(where, "the " + type + " texture " + quoted(name) + " is defined twice; rename one of the two");
}

void Parser::shape(Tokenizer* tokens, const Location& where) {
    require_world(where, "Shape", true);
    std::string kind = read_name(tokens, where, "Shape");
    ParameterList list = parameters(tokens, where, "Shape", kind, "shape");
    if (leave_out("Shape", &kind, &list)) return;
    PendingShape pending;
    pending.where = where;
    pending.material = state_.material;
    pending.object = current_object_;
    pending.area_light = state_.area_light;
    if (pending.area_light && current_object_ != kNone) {
        context_->diagnostics.warn(where, "an area light inside an object instance is ignored, as in pbrt: its shapes do not emit");
        pending.area_light = nullptr;
    }
    if (const Parameter* p = list.find("texture", "alpha")) {
        if (p->strings.size() != 1) fail(p->where, list.what() + ": \"texture alpha\" needs one texture name");
        pending.alpha_texture = p->strings[0];
    } else {
        pending.alpha = list.one_float("alpha", 1);
        if (pending.alpha < 0 || pending.alpha > 1) fail(where, list.what() + ": alpha must be between 0 and 1");
    }
    // Where faults are collected, those of the shape's light and material are to be found, too, although there is no
    // geometry for them.
    const bool good = context_->diagnostics.guard([&] {
        const Mat4 to_scene = static_transform(where, list.what());
        // An object has a space of its own, which its instances place.
        const Mat4 placed = current_object_ == kNone ? to_scene : *inverse(world_) * to_scene;
        pending.geometry =
            make_shape(context_, kind, list, {placed, state_.reverse_orientation, pending.area_light != nullptr}, &pending.faces);
        list.finish();
    });
    if (!good) pending.geometry = Sphere{}, pending.faces = {};
    if (!pending.area_light) pending.faces = {};
    pending.is_scaled_quadric = (kind == "sphere" || kind == "disk" || kind == "cylinder") && has_scale(state_.ctm[0]);
    context_->shapes.push_back(std::move(pending));
}

void Parser::object_begin(Tokenizer* tokens, const Location& where) {
    require_world(where, "ObjectBegin", true);
    const std::string name = read_name(tokens, where, "ObjectBegin");
    if (current_object_ != kNone) fail(where, "ObjectBegin inside another object; close that with ObjectEnd first");
    const int32_t index = int32_t(context_->scene.objects.size());
    if (!objects_.try_emplace(name, index).second)
        fail(where, "the object " + quoted(name) + " is defined twice; rename one of the two");
    open_scope('o', where);
    context_->scene.objects.push_back({name, {}, {}});
    current_object_ = index;
}

void Parser::object_instance(Tokenizer* tokens, const Location& where) {
    require_world(where, "ObjectInstance", true);
    const std::string name = read_name(tokens, where, "ObjectInstance");
    if (current_object_ != kNone)
        fail(where, "ObjectInstance inside ObjectBegin: nested instances are not supported; place the inner object outside");
    instances_.push_back({name, static_transform(where, "the instance"), where});
}

void Parser::place_instances() {
    for (const PendingInstance& i : instances_)
        context_->diagnostics.guard([&] {
            const auto it = objects_.find(i.object);
            if (it == objects_.end())
                fail(i.where, "ObjectInstance: no object is named " + quoted(i.object) + "; define it with ObjectBegin");
            context_->scene.instances.push_back({it->second, i.object_to_world, i.where.text()});
        });
}

}  // namespace lightloom::import
