#pragma once
// What the parts of the importer share: the scene under construction, the files, the diagnostics, and the tables that
// map names to definitions.

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "common/import/file_source.h"
#include "common/import/images.h"
#include "common/import/import.h"
#include "common/import/parameters.h"
#include "common/import/spectra.h"

namespace lightloom::import {

/// A material that absorbs nothing and scatters nothing: the shape does not exist for light ("interface").
inline constexpr MaterialId kInterfaceMaterial = -2;

/// Largest distance from the origin, and largest length: its square, and an area times a squared distance over another,
/// stay within single precision (Embree gives up beyond 1.8e18).
inline constexpr float kMaxCoordinate = 1e15f;
inline constexpr int kMaxDepth = 255;  ///< Edges of a path minus one; see kMaxEdges.

/// A material as a shape names it: a named one, or an anonymous one by its index.
struct MaterialReference {
    bool named = false;
    std::string name;   ///< Name of a named material.
    int anonymous = 0;  ///< Index into Context::anonymous_materials; 0 is pbrt's default, diffuse.
    Location where;
};

/// A Texture, Material or MakeNamedMaterial directive, interpreted when everything has been read (pbrt allows
/// references to later definitions).
struct Definition {
    std::string kind;  ///< "imagemap", "diffuse", ...
    ParameterList parameters;
    Mat4 to_world = {};  ///< For a texture: the transformation in force at its directive.
    bool moves = false;  ///< Whether the transformation changes while the shutter is open.
};

struct AreaLightDefinition {
    ParameterList parameters;
};

/// A shape with its references still unresolved.
struct PendingShape {
    std::variant<TriangleMesh, Sphere> geometry;
    std::vector<uint32_t> faces;  ///< Faces as make_shape() gives them; empty where they are not needed.
    int32_t object = kNone;       ///< Index into SceneDescription::objects, or kNone.
    MaterialReference material;
    std::shared_ptr<const AreaLightDefinition> area_light;  ///< Null if the shape does not emit.
    bool is_scaled_quadric = false;  ///< A sphere, disk or cylinder that its transformation makes larger or smaller.
    float alpha = 1;
    std::string alpha_texture;  ///< Empty if the shape has none.
    Location where;
};

/// The cost of evaluating a texture.
struct TextureCost {
    int levels = 1;     ///< Levels of recursion.
    double visits = 1;  ///< Nodes that are evaluated.
};

/// Bounds of a texture's first channel (float textures have no other); the texture need not reach them.
struct TextureRange {
    double least = 0, most = 0;
};

/// What a texture is used for decides which values it may have and how a spectrum is reduced (spectra.h). A spectrum
/// texture that is used both as a reflectance and as an index of refraction becomes two textures.
enum class TextureUse { kFloat, kReflectance, kUnbounded };

struct Context {
    /// `collects_faults`: see Diagnostics.
    Context(FileSource* source, const ImportOptions& import_options, bool collects_faults = false)
        : files(source),
          options(import_options),
          diagnostics(import_options.strict, collects_faults) {}

    FileSource* files;
    ImportOptions options;
    Diagnostics diagnostics;
    SceneDescription scene;

    std::set<std::string> file_names;  ///< Storage of Location::file.
    std::map<std::string, LeftOutFeature> left_out;
    std::optional<ImportFailure> old_syntax;  ///< The first directive that only pbrt before version 4 knows.

    std::vector<PendingShape> shapes;
    std::map<std::string, Definition> float_textures, spectrum_textures, named_materials;
    std::vector<Definition> anonymous_materials;

    // Caches of the resolution.
    std::map<std::pair<std::string, TextureUse>, TextureId> resolved_textures;
    std::map<std::string, MaterialId> resolved_named_materials;
    std::map<int, MaterialId> resolved_anonymous_materials;
    std::map<std::tuple<float, float, float>, TextureId> constants;
    std::map<decltype(Mat4::m), int32_t> texture_spaces;
    std::map<std::string, int32_t> image_index;  ///< Image by file, encoding and channel choice.
    std::map<std::tuple<float, float, float, bool, int32_t>, int32_t> emission_index;
    std::vector<TextureCost> texture_costs;        ///< One per scene texture.
    std::vector<TextureRange> texture_ranges;      ///< One per scene texture.
    std::map<int32_t, Rgb> image_means;            ///< Means of the images of area and goniometric lights.
    std::map<int32_t, TextureRange> image_ranges;  ///< Ranges of the one-channel images of textures, by their index.
    std::map<MaterialId, int> mix_levels;          ///< Levels of mix materials; others have none.
    int texture_depth = 0, material_depth = 0;     ///< Nesting of the definitions that are being resolved.

    float exposure_time = 1, iso = 100;       ///< Exposure time of the camera's shutter; ISO value of the film.
    std::optional<float> film_exposure_time;  ///< Exposure time that the film gives, as in early versions of pbrt-v4.
    FilmResponse::Matrix film_colour = FilmResponse::kNeutral;
    bool has_pixel_filter = false;

    /// Reports an unsupported feature: it is left out if the options say so, and is a fault otherwise.
    void unsupported(const Location& where, const std::string& feature, const std::string& what);
    /// Whether the options leave the feature out; counts the occurrence if so.
    bool leaves_out(const Location& where, std::string_view feature);
    /// Returns what `resolve` gives. Where faults are collected, a fault in it yields the placeholder instead, so that
    /// each definition is reported once.
    template <typename Id>
    Id resolve_or(const std::function<Id()>& placeholder, const std::function<Id()>& resolve);

    /// Reads a file that a parameter names. Fails at `where`.
    std::string read_file(const Location& where, const std::string& reference, std::string* normalised = nullptr);
    /// Index of the decoded image in the scene; a file is decoded once for each kind of request.
    int32_t load_image(const Location& where, const std::string& reference, const ImageRequest& request);
    /// Mean of an image of the scene, which many shapes may ask for.
    const Rgb& image_mean(int32_t image);
    /// The Location::file for a normalised name.
    const std::string* intern_file_name(const std::string& name);
};

template <typename Id>
Id Context::resolve_or(const std::function<Id()>& placeholder, const std::function<Id()>& resolve) {
    const int textures = texture_depth, materials = material_depth;
    Id id{};
    if (diagnostics.guard([&] { id = resolve(); })) return id;
    texture_depth = textures;
    material_depth = materials;
    return placeholder();
}

// textures.cpp
TextureId add_node(Context* context, const TextureNode& node);
TextureId constant_texture(Context* context, const Rgb& value);
TextureId named_texture(Context* context, const Location& where, const std::string& name, TextureUse use);
/// Parameter `name` as "float" or "texture"; kNone if absent.
TextureId float_texture_parameter(Context* context, const ParameterList& parameters, std::string_view name);

/// Parameter `name` as "rgb", "spectrum", "blackbody" or "texture"; kNone if absent. Not kFloat.
TextureId spectrum_texture_parameter(Context* context, const ParameterList& parameters, std::string_view name, TextureUse use);

/// The temperature of a parameter of type "blackbody"; fails if it is not one or out of range. `what` names the directive.
double kelvin_of(const Parameter& p, const std::string& what);
/// Parameter `name` as an operand of another texture; `fallback` if absent.
TextureId texture_operand(Context* context, const ParameterList& parameters, std::string_view name, TextureUse use, float fallback);

/// Parameter `name` of type "spectrum" read from its values or file; nothing if absent.
std::optional<Spectrum> spectrum_parameter(Context* context, const ParameterList& parameters, std::string_view name);

// procedural.cpp
/// The 2D mapping of a texture: from (u, v), or from the position in the space of its transformation.
void read_mapping(Context* context, const Definition& definition, TextureNode* node);
/// A checkerboard, dots, fbm, wrinkled, windy or marble; nothing for another kind.
std::optional<TextureId> procedural_texture(Context* context, const Definition& definition, TextureUse use);
/// Bounds of one of these textures, except of float textures that consist of others.
TextureRange noise_range(const TextureNode& node);
/// Noise evaluations of one look-up.
double noise_cost(const TextureNode& node);

// materials.cpp
MaterialId resolve_material_reference(Context* context, const MaterialReference& reference);

// lights.cpp
/// Adds a light; `light_to_world` is the transformation in force at its directive.
void add_light(Context* context, const std::string& kind, const ParameterList& parameters, const Mat4& light_to_world);
/// Whether no coordinate is beyond kMaxCoordinate (or not a number).
bool within_bounds(const Vec3& position);

/// Radiance of an area light on a surface of `area`, in world space: its "power" is emitted by each primitive, however
/// the primitive is scaled. (pbrt-v4 divides by the area that a sphere or disk has before its transformation.) Where an
/// image modulates the light, the power is that of a primitive that shows all of the image evenly, as in pbrt-v4.
AreaEmission area_emission(Context* context, const AreaLightDefinition& definition, double area);
bool area_light_uses_power(const AreaLightDefinition& definition);

// camera.cpp
void set_camera(Context* context, const std::string& kind, const ParameterList& parameters, const Mat4& camera_to_world);
void set_film(Context* context, const std::string& kind, const ParameterList& parameters);
/// The effect of a film's sensor and white balance on colours (sensor.cpp).
FilmResponse::Matrix sensor_colour(Context* context, const ParameterList& parameters);
void set_pixel_filter(Context* context, const std::string& kind, const ParameterList& parameters);
void set_sampler(Context* context, const std::string& kind, const ParameterList& parameters);
void set_integrator(Context* context, const std::string& kind, const ParameterList& parameters);

// shapes.cpp
/// State that a shape takes from the graphics state.
struct ShapeState {
    Mat4 object_to_world;
    bool reverse_orientation = false;
    bool emits = false;
};
/// The shape's geometry. `*faces` says for every triangle of a mesh which of pbrt's shapes it is a part of, as ascending
/// numbers without gaps; it is empty if every triangle is a shape of its own.
std::variant<TriangleMesh, Sphere> make_shape(Context* context, const std::string& kind, const ParameterList& parameters,
                                              const ShapeState& state, std::vector<uint32_t>* faces);

// resolve.cpp
/// Resolves all references and moves the shapes into the scene.
void resolve_shapes(Context* context);

}  // namespace lightloom::import
