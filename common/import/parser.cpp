#include "common/import/parser.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/import/features.h"
#include "common/import/foreign.h"

namespace lightloom::import {
namespace {

// All parameters that some kind of shape, light, material or texture has; an Attribute directive may set no others.
constexpr std::string_view kShapeParameters[] = {"float alpha",
                                                 "texture alpha",
                                                 "float radius",
                                                 "float zmin",
                                                 "float zmax",
                                                 "float phimax",
                                                 "float innerradius",
                                                 "float height",
                                                 "point3 P",
                                                 "normal N",
                                                 "vector3 S",
                                                 "point2 uv",
                                                 "integer indices",
                                                 "integer faceIndices",
                                                 "integer levels",
                                                 "string scheme",
                                                 "string filename",
                                                 "float edgelength",
                                                 "float displacement",
                                                 "texture displacement",
                                                 "string emissionfilename"};
constexpr std::string_view kLightParameters[] = {
    "rgb I",         "blackbody I",       "spectrum I",  "rgb L",     "blackbody L",     "spectrum L",           "float scale",
    "float power",   "float illuminance", "point3 from", "point3 to", "float coneangle", "float conedeltaangle", "string filename",
    "point3 portal", "bool twosided"};
constexpr std::string_view kMaterialParameters[] = {"string type",
                                                    "string normalmap",
                                                    "float displacement",
                                                    "texture displacement",
                                                    "rgb reflectance",
                                                    "spectrum reflectance",
                                                    "blackbody reflectance",
                                                    "texture reflectance",
                                                    "rgb transmittance",
                                                    "spectrum transmittance",
                                                    "blackbody transmittance",
                                                    "texture transmittance",
                                                    "float scale",
                                                    "float eta",
                                                    "rgb eta",
                                                    "spectrum eta",
                                                    "blackbody eta",
                                                    "texture eta",
                                                    "rgb k",
                                                    "spectrum k",
                                                    "blackbody k",
                                                    "texture k",
                                                    "float interface.eta",
                                                    "spectrum interface.eta",
                                                    "rgb conductor.eta",
                                                    "spectrum conductor.eta",
                                                    "blackbody conductor.eta",
                                                    "texture conductor.eta",
                                                    "rgb conductor.k",
                                                    "spectrum conductor.k",
                                                    "blackbody conductor.k",
                                                    "texture conductor.k",
                                                    "float roughness",
                                                    "texture roughness",
                                                    "float uroughness",
                                                    "texture uroughness",
                                                    "float vroughness",
                                                    "texture vroughness",
                                                    "float interface.roughness",
                                                    "texture interface.roughness",
                                                    "float interface.uroughness",
                                                    "texture interface.uroughness",
                                                    "float interface.vroughness",
                                                    "texture interface.vroughness",
                                                    "float conductor.roughness",
                                                    "texture conductor.roughness",
                                                    "float conductor.uroughness",
                                                    "texture conductor.uroughness",
                                                    "float conductor.vroughness",
                                                    "texture conductor.vroughness",
                                                    "bool remaproughness",
                                                    "float thickness",
                                                    "integer maxdepth",
                                                    "integer nsamples",
                                                    "float g",
                                                    "texture g",
                                                    "rgb albedo",
                                                    "spectrum albedo",
                                                    "texture albedo",
                                                    "string materials",
                                                    "float amount",
                                                    "texture amount"};
constexpr std::string_view kTextureParameters[] = {
    "float value",       "rgb value",        "spectrum value",      "blackbody value", "texture value",   "float tex",
    "rgb tex",           "spectrum tex",     "blackbody tex",       "texture tex",     "float tex1",      "rgb tex1",
    "spectrum tex1",     "blackbody tex1",   "texture tex1",        "float tex2",      "rgb tex2",        "spectrum tex2",
    "blackbody tex2",    "texture tex2",     "float scale",         "texture scale",   "float amount",    "texture amount",
    "integer dimension", "string mapping",   "float uscale",        "float vscale",    "float udelta",    "float vdelta",
    "string filename",   "string filter",    "float maxanisotropy", "string wrap",     "string encoding", "bool invert",
    "vector3 v1",        "vector3 v2",       "float inside",        "rgb inside",      "spectrum inside", "texture inside",
    "float outside",     "rgb outside",      "spectrum outside",    "texture outside", "integer octaves", "float roughness",
    "float variation",   "blackbody inside", "blackbody outside"};

std::string read_string(Tokenizer* tokens, const Location& where, const std::string& word) {
    const Token token = tokens->next();
    if (token.kind != TokenKind::kString) fail(where, word + " needs a quoted string");
    return std::string(token.text);
}

double read_number(Tokenizer* tokens, const Location& where, const std::string& word) {
    const Token token = tokens->peek();
    double value = 0;
    if (token.kind != TokenKind::kWord || !parse_number(token.text, &value))
        fail(token.where.line ? token.where : where,
             word + " needs a finite number" + (token.kind == TokenKind::kEnd ? "" : ", not " + quoted(std::string(token.text))));
    tokens->next();
    return value;
}

/// Reads `count` numbers, with or without brackets.
std::vector<double> read_numbers(Tokenizer* tokens, const Location& where, const std::string& word, int count) {
    const bool bracketed = tokens->peek().kind == TokenKind::kOpen;
    if (bracketed) tokens->next();
    std::vector<double> values;
    for (int i = 0; i < count; ++i) values.push_back(read_number(tokens, where, word));
    if (bracketed && tokens->next().kind != TokenKind::kClose)
        fail(where, word + " needs exactly " + std::to_string(count) + " numbers");
    return values;
}

/// pbrt writes a matrix column by column.
Mat4 read_matrix(Tokenizer* tokens, const Location& where, const std::string& word) {
    const std::vector<double> v = read_numbers(tokens, where, word, 16);
    Mat4 m;
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row) m.m[row][column] = v[size_t(column * 4 + row)];
    return m;
}

Vec3 vec3(const std::vector<double>& v, size_t first) { return {float(v[first]), float(v[first + 1]), float(v[first + 2])}; }

/// The word that a scope's directives begin with.
std::string scope_name(char kind) { return kind == 'a' ? "Attribute" : kind == 't' ? "Transform" : "Object"; }

}  // namespace

Parser::Parser(Context* context) : context_(context) {
    context_->anonymous_materials.push_back({"diffuse", ParameterList({}, "the default material")});
}

void Parser::parse_main(const std::string& name) {
    const Location where{context_->intern_file_name(name), 0};
    parse_file(name, where);
    context_->diagnostics.guard([&] {
        if (scopes_.empty()) return;
        const std::string name_of_scope = scope_name(scopes_.back().kind);
        fail(scopes_.back().where, "this " + name_of_scope + "Begin is never closed; add the missing " + name_of_scope + "End");
    });
    context_->diagnostics.guard([&] {
        if (!in_world_) fail(where, "the file has no WorldBegin; a scene needs one before its shapes and lights");
    });
    place_instances();
}

void Parser::parse_file(const std::string& name, const Location& from) {
    const std::string text = read_text(name, from);
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    std::string_view contents = text;
    if (contents.starts_with(kByteOrderMark)) contents.remove_prefix(kByteOrderMark.size());
    Tokenizer tokens(contents, context_->intern_file_name(name));
    open_files_.push_back(name);
    for (bool at_end = false; !at_end;) {
        const bool good = context_->diagnostics.guard([&] {
            at_end = tokens.peek().kind == TokenKind::kEnd;
            if (at_end) return;
            const Token token = tokens.next();
            directive(&tokens, token);
        });
        if (!good) skip_to_directive(&tokens);
    }
    open_files_.pop_back();
}

std::string Parser::read_text(const std::string& name, const Location& from) {
    Result<std::string> bytes = context_->files->read(name);
    if (!bytes.ok()) fail(from, bytes.status().message());
    std::string text = std::move(bytes).value();
    const uint64_t limit = context_->options.max_file_bytes;
    if (text.starts_with("\x1f\x8b")) {
        Result<std::string> inflated = inflate_gzip(text, limit);
        if (!inflated.ok()) fail(from, quoted(name) + ": " + inflated.status().message());
        text = std::move(inflated).value();
    } else if (has_suffix(name, ".gz")) {
        fail(from, quoted(name) + " is not compressed by gzip, although its name says so");
    }
    const Location itself{context_->intern_file_name(name), 0};
    if (is_lfs_pointer(text))
        fail(itself, "this is a pointer that Git LFS left in place of the file; fetch the file with `git lfs pull`");
    if (const std::optional<std::string> foreign = foreign_scene(name, text)) fail(itself, *foreign);
    // Text is counted per inclusion, because files that include each other several times multiply on every level.
    text_bytes_ += text.size();
    if (text_bytes_ > limit)
        fail(from, "the scene's text, with every file as often as it is included, has more than " + std::to_string(limit) +
                       " bytes; put repeated content into an object");
    return text;
}

void Parser::skip_to_directive(Tokenizer* tokens) {
    // Directives are words that begin with a capital; the only values that do so are the names of NaN and infinity.
    const auto begins_directive = [](const Token& token) {
        if (token.kind != TokenKind::kWord || token.text.empty()) return false;
        const bool is_value = token.text == "NaN" || token.text == "Inf" || token.text == "Infinity";
        return token.text[0] >= 'A' && token.text[0] <= 'Z' && !is_value;
    };
    for (bool found = false; !found;)
        // Text that cannot be read as a token is part of the same fault.
        try {
            found = tokens->peek().kind == TokenKind::kEnd || begins_directive(tokens->peek());
            if (!found) tokens->next();
        } catch (const ImportFailure&) {
        }
}

void Parser::directive(Tokenizer* tokens, const Token& token) {
    if (token.kind != TokenKind::kWord)
        fail(token.where, "expected a directive such as Shape, not " + quoted(std::string(token.text)));
    const std::string word(token.text);
    if (transformation(tokens, word, token.where) || scope(tokens, word, token.where) || global_option(tokens, word, token.where) ||
        world_item(tokens, word, token.where))
        return;
    note_old_syntax(token.where, word, "", {});
    fail(token.where, "unknown directive " + quoted(word) + "; remove it or correct its name");
}

/// Vertices are kept in single precision, which 100 km from the origin has steps of 8 mm. Scenes that transformations
/// put there are moved back by the camera's position in whole units before anything is rounded; numbers that are so
/// large in the file itself are read in single precision, as pbrt reads them.
void Parser::begin_world() {
    in_world_ = true;
    Mat4& camera_to_world = context_->scene.camera.camera_to_world;
    const auto whole = [](double coordinate) {
        constexpr double kFar = 2048;
        return std::fabs(coordinate) >= kFar ? std::round(coordinate) : 0.0;
    };
    const double w = camera_to_world.m[3][3];
    double shift[3];
    for (int i = 0; i < 3; ++i) context_->scene.origin[size_t(i)] = shift[i] = whole(camera_to_world.m[i][3] / w);
    world_ = translation(-shift[0], -shift[1], -shift[2]);
    camera_to_world = world_ * camera_to_world;
    for (auto& [name, system] : coordinate_systems_)
        for (Mat4& m : system.ctm) m = world_ * m;
    state_.ctm[0] = state_.ctm[1] = world_;
    state_.fault[0] = state_.fault[1] = {};
    state_.active[0] = state_.active[1] = true;
    coordinate_systems_["world"] = {{world_, world_}, {}};
}

bool Parser::transformation(Tokenizer* tokens, const std::string& word, const Location& where) {
    if (word == "Identity") {
        transform(where, [&](const Mat4&) { return world_; });
    } else if (word == "Translate") {
        const auto v = read_numbers(tokens, where, word, 3);
        transform(where, [&](const Mat4& m) { return m * translation(v[0], v[1], v[2]); });
    } else if (word == "Scale") {
        const auto v = read_numbers(tokens, where, word, 3);
        transform(where, [&](const Mat4& m) { return m * scaling(v[0], v[1], v[2]); });
    } else if (word == "Rotate") {
        const auto v = read_numbers(tokens, where, word, 4);
        if (std::fabs(v[0]) > 1e6) fail(where, "Rotate: the angle is beyond a million degrees");
        const bool has_axis = v[1] != 0 || v[2] != 0 || v[3] != 0;
        transform(
            where, [&](const Mat4& m) { return has_axis ? m * rotation(v[0], v[1], v[2], v[3]) : scaling(0, 0, 0); },
            "Rotate: the axis is zero");
    } else if (word == "LookAt") {
        const auto v = read_numbers(tokens, where, word, 9);
        if (!within_bounds(vec3(v, 0)) || !within_bounds(vec3(v, 3)))
            fail(where, "LookAt: the eye or the target lies beyond 1e15; scale the scene down");
        const std::optional<Mat4> look = look_at(vec3(v, 0), vec3(v, 3), vec3(v, 6));
        transform(
            where, [&](const Mat4& m) { return look ? m * *look : scaling(0, 0, 0); },
            "LookAt: the eye equals the target, or the up vector is parallel to the view direction");
    } else if (word == "Transform") {
        const Mat4 matrix = read_matrix(tokens, where, word);
        transform(where, [&](const Mat4&) { return world_ * matrix; });
    } else if (word == "ConcatTransform") {
        const Mat4 matrix = read_matrix(tokens, where, word);
        transform(where, [&](const Mat4& m) { return m * matrix; });
    } else if (word == "CoordinateSystem") {
        coordinate_systems_[read_string(tokens, where, word)] = {{state_.ctm[0], state_.ctm[1]},
                                                                 {state_.fault[0], state_.fault[1]}};
    } else if (word == "CoordSysTransform") {
        const std::string name = read_string(tokens, where, word);
        const auto it = coordinate_systems_.find(name);
        if (it == coordinate_systems_.end())
            fail(where,
                 "CoordSysTransform: no coordinate system is named " + quoted(name) + "; define it with CoordinateSystem first");
        for (int i = 0; i < 2; ++i) state_.ctm[i] = it->second.ctm[i], state_.fault[i] = it->second.fault[i];
    } else if (word == "ActiveTransform") {
        active_transform(tokens, where);
    } else if (word == "TransformTimes") {
        read_numbers(tokens, where, word, 2);  // This matters only for moving things, which are refused where used.
    } else if (word == "ReverseOrientation") {
        state_.reverse_orientation = !state_.reverse_orientation;
    } else {
        return false;
    }
    return true;
}

void Parser::active_transform(Tokenizer* tokens, const Location& where) {
    const Token token = tokens->next();
    const std::string which(token.text);
    if (which != "StartTime" && which != "EndTime" && which != "All")
        fail(where, "ActiveTransform needs StartTime, EndTime or All");
    state_.active[0] = which != "EndTime";
    state_.active[1] = which != "StartTime";
}

void Parser::transform(const Location& where, const std::function<Mat4(const Mat4&)>& f, std::string_view why) {
    for (int i = 0; i < 2; ++i) {
        if (!state_.active[i]) continue;
        state_.ctm[i] = f(state_.ctm[i]);
        TransformFault& fault = state_.fault[i];
        if (inverse(state_.ctm[i]))
            fault = {};
        else if (fault.why.empty())
            fault = {where, std::string(why.empty() ? "it becomes singular or infinite" : why)};
    }
}

const Mat4& Parser::static_transform(const Location& where, const std::string& what) {
    const TransformFault& fault = state_.fault[0];
    if (!fault.why.empty())
        fail(where, what + " cannot be placed with the transformation in force since " + fault.where.text() + ": " + fault.why +
                        "; correct its numbers");
    if (!(state_.ctm[0] == state_.ctm[1]))
        context_->unsupported(where, "motion", what + " moves while the shutter is open (ActiveTransform); motion");
    return state_.ctm[0];
}

bool Parser::scope(Tokenizer* tokens, const std::string& word, const Location& where) {
    if (word == "AttributeBegin") {
        open_scope('a', where);
    } else if (word == "AttributeEnd") {
        close_scope('a', word, where);
    } else if (word == "TransformBegin") {
        open_scope('t', where);
    } else if (word == "TransformEnd") {
        close_scope('t', word, where);
    } else if (word == "ObjectBegin") {
        object_begin(tokens, where);
    } else if (word == "ObjectEnd") {
        close_scope('o', word, where);
        current_object_ = kNone;
    } else if (word == "WorldBegin") {
        if (in_world_) fail(where, "a second WorldBegin; remove it");
        begin_world();
    } else if (word == "Include") {
        include(tokens, where);
    } else if (word == "Import") {
        import(tokens, where);
    } else if (word == "Attribute") {
        attribute(tokens, where);
    } else if (word == "Option") {
        option(tokens, where);
    } else if (word == "ColorSpace") {
        const std::string name = read_string(tokens, where, word);
        if (name != "srgb") fail(where, "ColorSpace " + quoted(name) + " is not supported; convert the colours to \"srgb\"");
    } else {
        return false;
    }
    return true;
}

void Parser::open_scope(char kind, const Location& where) {
    if (scopes_.size() >= kMaxScopeDepth) fail(where, "scopes are nested deeper than " + std::to_string(kMaxScopeDepth));
    scopes_.push_back({kind, state_, where});
}

void Parser::close_scope(char kind, const std::string& word, const Location& where) {
    if (scopes_.size() <= outer_scopes_)
        fail(where, word + " does not match any open scope" + (outer_scopes_ > 0 ? " of the imported file" : "") + "; remove it");
    if (scopes_.back().kind != kind) {
        const std::string open = scope_name(scopes_.back().kind);
        fail(where, word + " does not match the " + open + "Begin at " + scopes_.back().where.text() + "; close that with " + open +
                        "End first");
    }
    state_ = std::move(scopes_.back().state);
    scopes_.pop_back();
}

void Parser::include(Tokenizer* tokens, const Location& where) {
    const std::string reference = read_string(tokens, where, "Include");
    const Result<std::string> name = context_->files->resolve(reference);
    if (!name.ok()) fail(where, name.status().message());
    if (const auto first = std::find(open_files_.begin(), open_files_.end(), *name); first != open_files_.end()) {
        std::string circle;
        for (auto file = first; file != open_files_.end(); ++file) circle += *file + " > ";
        fail(where, "Include " + quoted(reference) + " goes round in a circle: " + circle + *name);
    }
    if (open_files_.size() > kMaxIncludeDepth)
        fail(where, "Include is nested deeper than " + std::to_string(kMaxIncludeDepth) + " files");
    if (++include_count_ > kMaxIncludes)
        fail(where,
             "the scene includes files more than " + std::to_string(kMaxIncludes) + " times; put repeated content into an object");
    parse_file(*name, where);
}

void Parser::import(Tokenizer* tokens, const Location& where) {
    require_world(where, "Import", true);
    // Unlike with Include, changes that the file makes to the graphics state end with it.
    const GraphicsState state = state_;
    const auto coordinate_systems = coordinate_systems_;
    const size_t outer = std::exchange(outer_scopes_, scopes_.size());
    context_->diagnostics.guard([&] {
        include(tokens, where);
        if (scopes_.size() != outer_scopes_)
            fail(where, "the imported file leaves the scope open that begins at " + scopes_.back().where.text());
    });
    scopes_.erase(scopes_.begin() + std::ptrdiff_t(outer_scopes_), scopes_.end());
    outer_scopes_ = outer;
    state_ = state;
    coordinate_systems_ = coordinate_systems;
}

void Parser::attribute(Tokenizer* tokens, const Location& where) {
    const std::string target = read_string(tokens, where, "Attribute");
    if (target != "shape" && target != "light" && target != "material" && target != "medium" && target != "texture")
        fail(where, "Attribute " + quoted(target) + ": the target must be shape, light, material, medium or texture");
    const std::string what = "Attribute " + quoted(target);
    ParameterList list = ParameterList::parse(tokens, where, what);
    list.report_to(&context_->diagnostics);
    if (target == "shape") list.check(kShapeParameters);
    if (target == "light") list.check(kLightParameters);
    if (target == "material") list.check(kMaterialParameters);
    if (target == "texture") list.check(kTextureParameters);
    if (target == "medium") list.ignore_all(&context_->diagnostics, "participating media are not supported, and none is used");
    state_.attributes.try_emplace(target, ParameterList(where, what)).first->second.override_with(list);
}

void Parser::require_world(const Location& where, const std::string& word, bool wanted) {
    if (in_world_ == wanted) return;
    context_->diagnostics.fault({where, word + (wanted ? " must come after WorldBegin" : " must come before WorldBegin"), {}});
    in_world_ = true;  // so that this is reported once
}

ParameterList Parser::parameters(Tokenizer* tokens, const Location& where, const std::string& word, const std::string& kind,
                                 const std::string& target) {
    note_old_syntax(where, word, kind, {});
    ParameterList list = ParameterList::parse(tokens, where, word + " " + quoted(kind));
    list.report_to(&context_->diagnostics);
    if (const auto it = state_.attributes.find(target); it != state_.attributes.end()) list.add_defaults(it->second);
    note_old_syntax(where, word, kind, list);
    return list;
}

void Parser::note_old_syntax(const Location& where, const std::string& word, const std::string& kind, const ParameterList& list) {
    if (context_->old_syntax || !(is_old_directive(word, kind) || has_old_parameter(word, list))) return;
    context_->old_syntax = ImportFailure{where, word + (kind.empty() ? "" : " " + quoted(kind)), {}};
}

bool Parser::leave_out(const std::string& word, std::string* kind, ParameterList* list) {
    bool all = false;
    for (const FeatureRule* rule : feature_rules(word, *kind, *list)) {
        const Parameter* p = rule->parameter.empty() ? nullptr : list->peek(rule->parameter);
        const Location& where = p ? p->where : list->where();
        const std::string what = p ? list->what() + ": " + quoted(p->type + " " + p->name) : list->what();
        const bool leaves_out = context_->leaves_out(where, rule->feature);
        if (!leaves_out && !rule->is_refused) continue;
        if (!leaves_out)
            context_->diagnostics.fault(
                {where, what + " is not supported" + how_to_leave_out(rule->feature, rule->becomes), std::string(rule->feature)});
        all = apply(*rule, kind, list) || all;
    }
    return all;
}

}  // namespace lightloom::import
