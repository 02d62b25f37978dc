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
    static constexpr size_t kMaxIncludeDepth = 64;
    /// Each inclusion takes some microseconds. The amount of text is limited, too, but files without any text can
    /// multiply by including one another.
    static constexpr int kMaxIncludes = 10'000'000;
    static constexpr size_t kMaxScopeDepth = 1024;

    /// Why a transformation cannot be undone: nothing may be placed with it, but a file may set it and place nothing.
    struct TransformFault {
        Location where;
        std::string why;  ///< Empty if it can be undone.
    };

    struct GraphicsState {
        Mat4 ctm[2];  ///< At the start and at the end of the shutter interval; only equal ones can be rendered.
        TransformFault fault[2];
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

    /// An instance whose object may be defined further down in the file.
    struct PendingInstance {
        std::string object;
        Mat4 object_to_world;
        Location where;
    };

    void parse_file(const std::string& name, const Location& from);
    /// The file's text, inflated if it is compressed. Fails for one of another format.
    std::string read_text(const std::string& name, const Location& from);
    /// After a fault, skips to the next word that begins a directive.
    void skip_to_directive(Tokenizer* tokens);
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

    /// Reads the parameters of a directive and adds the defaults of Attribute `target` (may be empty).
    ParameterList parameters(Tokenizer* tokens, const Location& where, const std::string& word, const std::string& kind,
                             const std::string& target);
    /// Leaves out the features of a directive (features.h) that the options name; `word` is "Material" for
    /// MakeNamedMaterial, too. True if nothing is left of the directive.
    bool leave_out(const std::string& word, std::string* kind, ParameterList* list);
    /// Remembers the first directive of pbrt before version 4.
    void note_old_syntax(const Location& where, const std::string& word, const std::string& kind, const ParameterList& list);
    /// Applies `f` to the transformations that ActiveTransform selects. `why` explains a transformation that `f` makes
    /// singular.
    void transform(const Location& where, const std::function<Mat4(const Mat4&)>& f, std::string_view why = {});
    /// The transformation of a shape, light, instance or camera; fails if it moves or cannot be undone.
    const Mat4& static_transform(const Location& where, const std::string& what);
    void require_world(const Location& where, const std::string& word, bool wanted);

    Context* context_;
    GraphicsState state_;
    std::vector<Scope> scopes_;
    size_t outer_scopes_ = 0;  ///< Number of scopes that the file being imported may not close.
    struct CoordinateSystem {
        Mat4 ctm[2];
        TransformFault fault[2];
    };
    void begin_world();
    /// Maps the file's world space to the scene's, whose origin lies near the camera where the camera is far away; see
    /// begin_world().
    Mat4 world_;
    std::map<std::string, CoordinateSystem> coordinate_systems_;
    std::map<std::string, int32_t> objects_;
    std::vector<PendingInstance> instances_;
    std::map<std::string, bool> media_;
    int32_t current_object_ = kNone;
    std::vector<std::string> open_files_;  ///< The file that is being read and those that include it, outermost first.
    int include_count_ = 0;
    uint64_t text_bytes_ = 0;  ///< Bytes of all files, as often as they are included.
    bool in_world_ = false;
};

}  // namespace lightloom::import
