#pragma once
// The directives of a pbrt-v4 file: graphics state, transformations, named things, and dispatch of the rest.

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/import/context.h"

namespace lightloom::import {

class Parser {
  public:
    explicit Parser(Context* context);

    /// Interprets `name`, a normalised path, and all that it includes.
    void parse_main(const std::string& name);

  private:
    static constexpr int kMaxIncludeDepth = 16;
    static constexpr int kMaxIncludes = 100000;
    static constexpr size_t kMaxScopeDepth = 1024;

    struct GraphicsState {
        Mat4 ctm[2];  ///< At the start and at the end of the shutter interval; only equal ones can be rendered.
        bool active[2] = {true, true};
        bool reverse_orientation = false;
        MaterialReference material;
        std::shared_ptr<const AreaLightDefinition> area_light;
        std::map<std::string, ParameterList> attributes;  ///< Defaults by target: shape, light, material, medium, texture.
    };
    struct Scope {
        char kind;  ///< 'a' AttributeBegin, 't' TransformBegin, 'o' ObjectBegin.
        GraphicsState state;
        Location where;
    };

    /// Its object may be defined further down.
    struct PendingInstance {
        std::string object;
        Mat4 object_to_world;
        Location where;
    };

    void parse_file(const std::string& name, const Location& from);
    void directive(Tokenizer* tokens, const Token& token);
    bool transformation(Tokenizer* tokens, const std::string& word, const Location& where);
    bool scope(Tokenizer* tokens, const std::string& word, const Location& where);
    bool global_option(Tokenizer* tokens, const std::string& word, const Location& where);
    bool world_item(Tokenizer* tokens, const std::string& word, const Location& where);

    void include(Tokenizer* tokens, const Location& where);
    void import(Tokenizer* tokens, const Location& where);
    void option(Tokenizer* tokens, const Location& where);
    void attribute(Tokenizer* tokens, const Location& where);
    void active_transform(Tokenizer* tokens, const Location& where);
    void open_scope(char kind, const Location& where);
    void close_scope(char kind, const std::string& word, const Location& where);
    void object_begin(Tokenizer* tokens, const Location& where);
    void object_instance(Tokenizer* tokens, const Location& where);
    void place_instances();
    void texture(Tokenizer* tokens, const Location& where);
    void shape(Tokenizer* tokens, const Location& where);
    void medium_interface(Tokenizer* tokens, const Location& where);

    /// "Word "kind" parameters" with the defaults of Attribute `target` (may be empty) added.
    ParameterList parameters(Tokenizer* tokens, const Location& where, const std::string& word, const std::string& kind,
                             const std::string& target);
    /// Applies `f` to the transformations that ActiveTransform selects; fails if one becomes singular.
    void transform(const Location& where, const std::function<Mat4(const Mat4&)>& f);
    /// The transformation of a shape, light or camera; fails if it moves.
    const Mat4& static_transform(const Location& where, const std::string& what) const;
    void require_world(const Location& where, const std::string& word, bool wanted) const;

    Context* context_;
    GraphicsState state_;
    std::vector<Scope> scopes_;
    size_t outer_scopes_ = 0;  ///< Those of them that the file being imported may not close.
    std::map<std::string, std::array<Mat4, 2>> coordinate_systems_;
    std::map<std::string, int32_t> objects_;
    std::vector<PendingInstance> instances_;
    std::map<std::string, bool> media_;
    int32_t current_object_ = kNone;
    int include_depth_ = 0, include_count_ = 0;
    bool in_world_ = false;
};

}  // namespace lightloom::import
