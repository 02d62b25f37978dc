#pragma once
// SceneDescription: what an importer produces and Scene::build() consumes. Plain data, in world space, in the units of the
// scene file. Every reference is an index into one of the vectors.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/core/transform.h"
#include "common/core/vec.h"
#include "common/film/response.h"
#include "common/scene/image.h"

namespace lightloom {

/// Index of a TextureNode. Every material parameter is one; constants are nodes of kind kConstant.
using TextureId = int32_t;
using MaterialId = int32_t;
inline constexpr int32_t kNone = -1;

enum class TextureKind : uint8_t {
    kConstant,
    kScale,
    kMix,
    kCheckerboard,
    kImage,
    kSolidCheckerboard,
    kDots,
    kFractal,
    kWrinkled,
    kWindy,
    kMarble,
};
enum class WrapMode : uint8_t { kRepeat, kClamp, kBlack };

/// How 2D textures get their (s, t). All mappings but kUv depend on the position in space.
enum class TextureMapping : uint8_t {
    kUv,           ///< su u + du and sv v + dv.
    kPlanar,       ///< The first two coordinates in the texture's space.
    kSpherical,    ///< Polar angle over pi and azimuth over 2 pi in the texture's space.
    kCylindrical,  ///< Azimuth over 2 pi, from the negative x axis, and z in the texture's space.
};

struct TextureNode {
    TextureKind kind = TextureKind::kConstant;
    uint8_t octaves = 0;             ///< kFractal, kWrinkled, kMarble.
    Rgb value{0.0f};                 ///< kConstant. A float texture has three equal components.
    TextureId a = kNone, b = kNone;  ///< kScale: a * b. kMix: (1-amount) a + amount b. Checkerboards: the two colours. kDots:
                                     ///< inside and outside.
    TextureId amount = kNone;        ///< kMix only.
    int32_t image = kNone;           ///< kImage: index into SceneDescription::images.
    WrapMode wrap = WrapMode::kRepeat;
    bool nearest = false;                          ///< kImage: point lookup; bilinear otherwise.
    bool invert = false;                           ///< kImage: 1 - the scaled value (pbrt's order).
    bool non_negative = true;                      ///< kImage: negative values become 0 (pbrt: colours, inverted values).
    TextureMapping mapping = TextureMapping::kUv;  ///< kCheckerboard, kImage, kDots.
    float scale = 1;                               ///< kImage: multiplies the value. kMarble: multiplies the position.
    float su = 1, sv = 1, du = 0, dv = 0;          ///< TextureMapping::kUv.
    int32_t space = kNone;  ///< Index into SceneDescription::texture_spaces: other mappings, and the kinds that are functions of
                            ///< the position (kSolidCheckerboard, kFractal and below).
    float omega = 0;        ///< kFractal, kWrinkled, kMarble: ratio of successive amplitudes.
    float variation = 0;    ///< kMarble: how far noise bends its layers.
};

enum class MaterialKind : uint8_t {
    kDiffuse,
    kDiffuseTransmission,
    kConductor,
    kDielectric,
    kThinDielectric,
    kCoatedDiffuse,
    kCoatedConductor,
    kMix,
};

/// A material before texture evaluation. Unused slots stay kNone.
struct Material {
    MaterialKind kind = MaterialKind::kDiffuse;
    std::string name;                  ///< As in the scene file; empty for anonymous ones.
    TextureId reflectance = kNone;     ///< kDiffuse, kDiffuseTransmission, kCoatedDiffuse (base), or a conductor's F0.
    TextureId transmittance = kNone;   ///< kDiffuseTransmission.
    TextureId eta = kNone, k = kNone;  ///< kConductor (used when reflectance is kNone); base of kCoatedConductor.
    TextureId roughness_u = kNone, roughness_v = kNone;            ///< GGX roughness (of the coat for coated kinds).
    TextureId base_roughness_u = kNone, base_roughness_v = kNone;  ///< kCoatedConductor's conductor.
    bool remap_roughness = true;              ///< pbrt: alpha = sqrt(roughness) if true, alpha = roughness otherwise.
    float ior = 1.5f;                         ///< Relative index of (thin) dielectric or of the coat.
    float thickness = 0.01f;                  ///< Of a coat, optical: every crossing transmits exp(-thickness / cos).
    int layer_events = 10;                    ///< kCoatedDiffuse: scattering events between coat and base that are followed, as
                                              ///< pbrt's "maxdepth"; every other one is a base reflection. 0: all.
    MaterialId mix_a = kNone, mix_b = kNone;  ///< kMix: a with probability 1 - amount, b with probability amount.
    TextureId mix_amount = kNone;
    // These tilt the shading normal, see bump.h; at most one is used, and a kMix has neither.
    TextureId displacement = kNone;  ///< Height above the surface along the shading normal, scene units; the first channel counts.
    TextureId normal_map = kNone;    ///< Unit normal n in the shading frame (s, t, n) as (n + 1) / 2.
};

/// Emission of an area light, attached to shapes. Radiance, W / (m^2 sr) per colour channel, scene units.
struct AreaEmission {
    Rgb radiance;  ///< Multiplies the image, or is the radiance when there is none.
    bool two_sided = false;
    int32_t image = kNone;  ///< Index into images; looked up by the shape's (u, v), see SurfaceMap.
};

/// Attributes that all kinds of shapes have.
struct ShapeAttributes {
    MaterialId material = kNone;
    int32_t emission = kNone;  ///< Index into SceneDescription::emissions.
    TextureId alpha = kNone;   ///< Cut-out opacity in [0, 1]; kNone is opaque.
    bool flip_normal = false;  ///< Reverses the geometric normal cross(p1 - p0, p2 - p0) (pbrt: ReverseOrientation xor
                               ///< a handedness-swapping transformation).
    std::string source;        ///< "file:line" of the shape, for messages.
    bool mirrored = false;     ///< The transformation that placed the shape swaps handedness: so does the frame of its tangents.
};

struct TriangleMesh {
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;      ///< Empty, or one per position; unit length, world space. As in pbrt, the geometric
                                    ///< normal of a triangle is flipped into the hemisphere of its shading normals.
    std::vector<Vec2> uvs;          ///< Empty, or one per position; empty means (0,0) (1,0) (1,1) at the three corners.
    std::vector<uint32_t> indices;  ///< Three per triangle.
    bool curved = false;            ///< Stands for a curved surface and has its tangents, see tangents_of() in bump.h.
    ShapeAttributes attributes;
};

struct Sphere {
    Vec3 centre;
    float radius = 1;
    /// Rotation from the sphere's own axes to the world, for its (u, v) parametrisation (pbrt: u about z, v along z).
    Frame orientation{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    ShapeAttributes attributes;
};

/// A named group of shapes in its own space, placed by Instance. Shapes inside may not emit.
struct ObjectDefinition {
    std::string name;
    std::vector<TriangleMesh> meshes;
    std::vector<Sphere> spheres;
};

struct Instance {
    int32_t object = kNone;
    Mat4 object_to_world;
    std::string source;
};

struct PointLight {
    Vec3 position;
    Rgb intensity;            ///< W / sr.
    std::string source = {};  ///< "file:line" of the light; empty if none is known.
};

struct SpotLight {
    Vec3 position;
    Frame axes;     ///< axes.n is the direction of the axis, away from the light.
    Rgb intensity;  ///< On the axis, W / sr.
    // The next two are 1 - cosine of an angle, which keeps the digits that the cosine of a narrow cone loses.
    float total_height = 0;    ///< For the angle beyond which there is no light.
    float falloff_height = 0;  ///< For the angle within which it has full intensity; smoothstep between.
    std::string source = {};
};

/// A light at a point whose intensity an image gives by direction; see DirectionMap.
struct ImageLight {
    enum class Kind : uint8_t { kProjection, kGoniometric };
    Kind kind = Kind::kProjection;
    Vec3 position;
    Mat4 light_to_world;                    ///< Rotation (and reflection) part is used.
    float half_width = 1, half_height = 1;  ///< kProjection: size of the picture at distance 1.
    Rgb intensity{1.0f};                    ///< Multiplies the image, W / sr.
    int32_t image = kNone;                  ///< Index into images; square for kGoniometric.
    std::string source = {};
};

struct DistantLight {
    Vec3 direction;  ///< Unit vector in which the light travels.
    Rgb irradiance;  ///< On a surface facing it, W / m^2.
    std::string source = {};
};

struct InfiniteLight {
    Mat4 light_to_world;    ///< Rotation (and reflection) part is used.
    Rgb radiance{1.0f};     ///< Multiplies the image, or is the constant radiance when there is none.
    int32_t image = kNone;  ///< Equal-area octahedral square map, index into images.
    std::string source = {};
};

enum class CameraKind : uint8_t {
    kPerspective,
    kOrthographic,     ///< Rays along +z from the screen window in the plane z = 0, in the camera's units. No lens.
    kEqualArea,        ///< All directions, the equal-area octahedral square about +y filling the frame. No lens.
    kEquirectangular,  ///< All directions: from +y at the top to -y, and from +x over +z, -x and -z from left to right. No lens.
};

struct CameraDescription {
    CameraKind kind = CameraKind::kPerspective;
    Mat4 camera_to_world;    ///< Camera looks along +z, +y up, +x right; may mirror.
    float fov_degrees = 90;  ///< kPerspective: of the shorter image side.
    /// pbrt's screen window; when unset (`has_screen_window` false) it follows the film's aspect ratio.
    bool has_screen_window = false;
    float screen_window[4] = {-1, 1, -1, 1};  ///< x0, x1, y0, y1.
    float frame_aspect_ratio = 0;             ///< 0: width / height.
    float lens_radius = 0;                    ///< 0 is a pinhole.
    float focal_distance = 1e6f;
};

struct FilmDescription {
    int width = 1280, height = 720;
    /// Crop window in pixels, half open: x0, x1, y0, y1; all -1 means the whole frame.
    int crop[4] = {-1, -1, -1, -1};
    FilmResponse response;
    std::string file_name;  ///< As in the scene file; the command line decides where pictures go.
};

struct SceneDescription {
    std::vector<TriangleMesh> meshes;
    std::vector<Sphere> spheres;
    /// Surfaces that emit but are invisible: no ray meets them (pbrt: area lights with alpha 0).
    std::vector<TriangleMesh> hidden_meshes;
    std::vector<Sphere> hidden_spheres;
    std::vector<ObjectDefinition> objects;
    std::vector<Instance> instances;
    std::vector<Material> materials;
    std::vector<TextureNode> textures;
    std::vector<Mat4> texture_spaces;  ///< Each maps world space to the space in which a texture is defined.
    std::vector<Image> images;
    std::vector<AreaEmission> emissions;
    std::vector<PointLight> point_lights;
    std::vector<SpotLight> spot_lights;
    std::vector<ImageLight> image_lights;
    std::vector<DistantLight> distant_lights;
    std::vector<InfiniteLight> infinite_lights;
    CameraDescription camera;
    FilmDescription film;
    int max_depth = 5;           ///< Bounces, as in pbrt: paths have up to max_depth + 1 edges.
    int samples_per_pixel = 16;  ///< As the file asks for; the command line may override it.
    /// The scene's origin in the file's coordinates: the world is moved so that single precision suffices around the
    /// camera.
    std::array<double, 3> origin{};
    /// Power of two by which every light was multiplied and the film's exposure divided.
    double strength_scale = 1;
    std::string integrator;             ///< As in the scene file, empty if it has none; the client takes its default from it.
    std::vector<std::string> warnings;  ///< Named warnings: "file:line: what was ignored and why that matters".
};

/// Checks what rendering relies on in shapes, instances, and the strength of area, image and infinite lights: indices
/// in range, finite numbers, areas within single precision, invertible matrices. kInvalidArgument names the first
/// violation, for a shape with its place in the scene file. import_pbrt() and Scene::build() call it; the importer
/// guarantees everything else.
Status validate(const SceneDescription& description);

/// Whether a transformation is made of rotations, translations, reflections and one scale for all axes, as a camera's must be.
bool keeps_angles(const Mat4& transformation);

}  // namespace lightloom
