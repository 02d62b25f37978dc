#include "common/import/parser.h"

#include <cmath>
#include <utility>

namespace lightloom::import {
namespace {

// What some kind of shape, light, material or texture asks for: an Attribute directive may set nothing else.
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
                                                    "texture reflectance",
                                                    "rgb transmittance",
                                                    "spectrum transmittance",
                                                    "texture transmittance",
                                                    "float scale",
                                                    "float eta",
                                                    "rgb eta",
                                                    "spectrum eta",
                                                    "texture eta",
                                                    "rgb k",
                                                    "spectrum k",
                                                    "texture k",
                                                    "float interface.eta",
                                                    "spectrum interface.eta",
                                                    "rgb conductor.eta",
                                                    "spectrum conductor.eta",
                                                    "texture conductor.eta",
                                                    "rgb conductor.k",
                                                    "spectrum conductor.k",
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
    "float value",     "rgb value",       "spectrum value",    "texture value",  "float tex",           "rgb tex",
    "spectrum tex",    "texture tex",     "float tex1",        "rgb tex1",       "spectrum tex1",       "texture tex1",
    "float tex2",      "rgb tex2",        "spectrum tex2",     "texture tex2",   "float scale",         "texture scale",
    "float amount",    "texture amount",  "integer dimension", "string mapping", "float uscale",        "float vscale",
    "float udelta",    "float vdelta",    "string filename",   "string filter",  "float maxanisotropy", "string wrap",
    "string encoding", "bool invert",     "vector3 v1",        "vector3 v2",     "float inside",        "rgb inside",
    "spectrum inside", "texture inside",  "float outside",     "rgb outside",    "spectrum outside",    "texture outside",
    "integer octaves", "float roughness", "float variation"};

std::string read_string(Tokenizer* tokens, const Location& where, const std::string& word) {
    const Token token = tokens->next();
    if (token.kind != TokenKind::kString) fail(where, word + " needs a quoted string");
    return std::string(token.text);
}

double read_number(Tokenizer* tokens, const Location& where, const std::string& word) {
    const Token token = tokens->next();
    double value = 0;
    if (token.kind != TokenKind::kWord || !parse_number(token.text, &value))
        fail(token.where.line ? token.where : where,
             word + " needs a finite number" + (token.kind == TokenKind::kEnd ? "" : ", not " + quoted(std::string(token.text))));
    return value;
}

/// `count` numbers, with or without brackets.
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

/// What a scope's directives begin with.
std::string scope_name(char kind) { return kind == 'a' ? "Attribute" : kind == 't' ? "Transform" : "Object"; }

}  // namespace

Parser::Parser(Context* context) : context_(context) {
    context_->anonymous_materials.push_back({"diffuse", ParameterList({}, "the default material")});
}

void Parser::parse_main(const std::string& name) {
    const Location where{context_->intern_file_name(name), 0};
    parse_file(name, where);
    if (!scopes_.empty()) {
        const std::string name_of_scope = scope_name(scopes_.back().kind);
        fail(scopes_.back().where, "this " + name_of_scope + "Begin is never closed; add the missing " + name_of_scope + "End");
    }
    if (!in_world_) fail(where, "the file has no WorldBegin; a scene needs one before its shapes and lights");
    place_instances();
}

void Parser::parse_file(const std::string& name, const Location& from) {
    std::string text = context_->read_file(from, name);
    if (has_suffix(name, ".gz")) {
        Result<std::string> inflated = inflate_gzip(text, context_->options.max_file_bytes);
        if (!inflated.ok()) fail(from, quoted(name) + ": " + inflated.status().message());
        text = std::move(inflated).value();
    }
    Tokenizer tokens(text, context_->intern_file_name(name));
    while (tokens.peek().kind != TokenKind::kEnd) {
        const Token token = tokens.next();
        directive(&tokens, token);
    }
}

void Parser::directive(Tokenizer* tokens, const Token& token) {
    if (token.kind != TokenKind::kWord)
        fail(token.where, "expected a directive such as Shape, not " + quoted(std::string(token.text)));
    const std::string word(token.text);
    if (transformation(tokens, word, token.where) || scope(tokens, word, token.where) || global_option(tokens, word, token.where) ||
        world_item(tokens, word, token.where))
        return;
    fail(token.where, "unknown directive " + quoted(word) + "; remove it or correct its name");
}

bool Parser::transformation(Tokenizer* tokens, const std::string& word, const Location& where) {
    if (word == "Identity") {
        transform(where, [](const Mat4&) { return Mat4(); });
    } else if (word == "Translate") {
        const auto v = read_numbers(tokens, where, word, 3);
        transform(where, [&](const Mat4& m) { return m * translation(v[0], v[1], v[2]); });
    } else if (word == "Scale") {
        const auto v = read_numbers(tokens, where, word, 3);
        transform(where, [&](const Mat4& m) { return m * scaling(v[0], v[1], v[2]); });
    } else if (word == "Rotate") {
        const auto v = read_numbers(tokens, where, word, 4);
        if (std::fabs(v[0]) > 1e6) fail(where, "Rotate: the angle is beyond a million degrees");
        if (v[1] == 0 && v[2] == 0 && v[3] == 0) fail(where, "Rotate: the axis is zero");
        transform(where, [&](const Mat4& m) { return m * rotation(v[0], v[1], v[2], v[3]); });
    } else if (word == "LookAt") {
        const auto v = read_numbers(tokens, where, word, 9);
        if (!within_bounds(vec3(v, 0)) || !within_bounds(vec3(v, 3)))
            fail(where, "LookAt: the eye or the target lies beyond 1e15; scale the scene down");
        const std::optional<Mat4> look = look_at(vec3(v, 0), vec3(v, 3), vec3(v, 6));
        if (!look) fail(where, "LookAt: the eye equals the target, or the up vector is parallel to the view direction");
        transform(where, [&](const Mat4& m) { return m * *look; });
    } else if (word == "Transform") {
        const Mat4 matrix = read_matrix(tokens, where, word);
        transform(where, [&](const Mat4&) { return matrix; });
    } else if (word == "ConcatTransform") {
        const Mat4 matrix = read_matrix(tokens, where, word);
        transform(where, [&](const Mat4& m) { return m * matrix; });
    } else if (word == "CoordinateSystem") {
        coordinate_systems_[read_string(tokens, where, word)] = {state_.ctm[0], state_.ctm[1]};
    } else if (word == "CoordSysTransform") {
        const std::string name = read_string(tokens, where, word);
        const auto it = coordinate_systems_.find(name);
        if (it == coordinate_systems_.end())
            fail(where,
                 "CoordSysTransform: no coordinate system is named " + quoted(name) + "; define it with CoordinateSystem first");
        state_.ctm[0] = it->second[0];
        state_.ctm[1] = it->second[1];
    } else if (word == "ActiveTransform") {
        active_transform(tokens, where);
    } else if (word == "TransformTimes") {
        read_numbers(tokens, where, word, 2);  // Matters only for moving things, which are refused where they are used.
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

void Parser::transform(const Location& where, const std::function<Mat4(const Mat4&)>& f) {
    for (int i = 0; i < 2; ++i) {
        if (!state_.active[i]) continue;
        state_.ctm[i] = f(state_.ctm[i]);
        if (!inverse(state_.ctm[i])) fail(where, "the transformation becomes singular or infinite here; correct its numbers");
    }
}

const Mat4& Parser::static_transform(const Location& where, const std::string& what) const {
    if (!(state_.ctm[0] == state_.ctm[1]))
        fail(where, what +
                        " moves while the shutter is open (ActiveTransform); motion is not supported, remove one of "
                        "the transformations");
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
        in_world_ = true;
        state_.ctm[0] = state_.ctm[1] = Mat4();
        state_.active[0] = state_.active[1] = true;
        coordinate_systems_["world"] = {Mat4(), Mat4()};
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
    const Result<std::string> name = normalise_reference(reference);
    if (!name.ok()) fail(where, name.status().message());
    if (include_depth_ >= kMaxIncludeDepth)
        fail(where, "Include is nested deeper than " + std::to_string(kMaxIncludeDepth) + " files; does " + quoted(reference) +
                        " include itself?");
    // Files that include each other several times multiply on every level.
    if (++include_count_ > kMaxIncludes)
        fail(where,
             "the scene includes files more than " + std::to_string(kMaxIncludes) + " times; put repeated content into an object");
    ++include_depth_;
    parse_file(*name, where);
    --include_depth_;
}

void Parser::import(Tokenizer* tokens, const Location& where) {
    require_world(where, "Import", true);
    // Unlike Include, what the file does to the graphics state ends with it.
    const GraphicsState state = state_;
    const auto coordinate_systems = coordinate_systems_;
    const size_t outer = std::exchange(outer_scopes_, scopes_.size());
    include(tokens, where);
    if (scopes_.size() != outer_scopes_)
        fail(where, "the imported file leaves the scope open that begins at " + scopes_.back().where.text());
    outer_scopes_ = outer;
    state_ = state;
    coordinate_systems_ = coordinate_systems;
}

void Parser::attribute(Tokenizer* tokens, const Location& where) {
    const std::string target = read_string(tokens, where, "Attribute");
    if (target != "shape" && target != "light" && target != "material" && target != "medium" && target != "texture")
        fail(where, "Attribute " + quoted(target) + ": the target must be shape, light, material, medium or texture");
    const std::string what = "Attribute " + quoted(target);
    const ParameterList list = ParameterList::parse(tokens, where, what);
    if (target == "shape") list.check(kShapeParameters);
    if (target == "light") list.check(kLightParameters);
    if (target == "material") list.check(kMaterialParameters);
    if (target == "texture") list.check(kTextureParameters);
    if (target == "medium") list.ignore_all(&context_->diagnostics, "participating media are not supported, and none is used");
    state_.attributes.try_emplace(target, ParameterList(where, what)).first->second.override_with(list);
}

void Parser::require_world(const Location& where, const std::string& word, bool wanted) const {
    if (in_world_ == wanted) return;
    fail(where, word + (wanted ? " must come after WorldBegin" : " must come before WorldBegin"));
}

ParameterList Parser::parameters(Tokenizer* tokens, const Location& where, const std::string& word, const std::string& kind,
                                 const std::string& target) {
    ParameterList list = ParameterList::parse(tokens, where, word + " " + quoted(kind));
    if (const auto it = state_.attributes.find(target); it != state_.attributes.end()) list.add_defaults(it->second);
    return list;
}

}  // namespace lightloom::import
