// Textures that are computed: checkerboards, dots and noise; and the mappings of 2D textures.

#include <cmath>

#include "common/import/context.h"
#include "common/scene/noise.h"

namespace lightloom::import {
namespace {

/// Most octaves: with higher frequencies single precision would leave a position in the texture no fraction.
constexpr int kMaxOctaves = 32;
/// Amplitudes grow with the roughness; its power kMaxOctaves stays well within single precision.
constexpr float kMaxRoughness = 4;

/// Maps world space to the space of a texture.
Mat4 world_to_texture(const Definition& definition) {
    const ParameterList& parameters = definition.parameters;
    if (definition.moves)
        fail(parameters.where(), parameters.what() +
                                     " moves while the shutter is open (ActiveTransform); motion is not supported, remove one of "
                                     "the transformations or render with --without motion");
    const std::optional<Mat4> inverted = inverse(definition.to_world);
    if (!inverted) fail(parameters.where(), parameters.what() + ": its transformation is singular");
    return *inverted;
}

/// Index of an equal space, or of a new one.
int32_t add_space(Context* context, const Mat4& space) {
    const auto [it, inserted] = context->texture_spaces.try_emplace(space.m, int32_t(context->scene.texture_spaces.size()));
    if (inserted) context->scene.texture_spaces.push_back(space);
    return it->second;
}

/// The space whose first two coordinates are pbrt's planar (s, t): the products of the position with v1 and v2, plus
/// udelta and vdelta.
Mat4 planar_space(const ParameterList& parameters, const Mat4& m) {
    const auto axis = [&](std::string_view name, const std::array<double, 3>& fallback) {
        const std::vector<double>* v = parameters.numbers("vector3", name, 3);
        if (!v) return fallback;
        if (v->size() != 3) fail(parameters.where(), parameters.what() + ": " + std::string(name) + " needs three numbers");
        return std::array<double, 3>{(*v)[0], (*v)[1], (*v)[2]};
    };
    const std::array<double, 3> axes[2] = {axis("v1", {1, 0, 0}), axis("v2", {0, 1, 0})};
    const double delta[2] = {double(parameters.one_float("udelta", 0)), double(parameters.one_float("vdelta", 0))};
    Mat4 out = m;
    for (size_t row = 0; row < 2; ++row)
        for (size_t c = 0; c < 4; ++c) {
            const auto& v = axes[row];
            out.m[row][c] = v[0] * m.m[0][c] + v[1] * m.m[1][c] + v[2] * m.m[2][c] + delta[row] * m.m[3][c];
        }
    return out;
}

void read_octaves(const ParameterList& parameters, TextureNode* node) {
    const int octaves = parameters.one_int("octaves", 8);
    if (octaves < 0 || octaves > kMaxOctaves)
        fail(parameters.where(), parameters.what() + ": octaves must lie between 0 and " + std::to_string(kMaxOctaves));
    node->octaves = uint8_t(octaves);
    node->omega = parameters.one_float("roughness", 0.5f);
    if (!(node->omega >= 0 && node->omega <= kMaxRoughness))
        fail(parameters.where(), parameters.what() + ": roughness must lie between 0 and 4");
}

/// Sum of the amplitudes of all octaves.
double amplitudes(const TextureNode& node, double* last) {
    double sum = 0, amplitude = 1;
    for (int i = 0; i < node.octaves; ++i) {
        sum += amplitude;
        amplitude *= double(node.omega);
    }
    *last = amplitude;
    return sum;
}

}  // namespace

void read_mapping(Context* context, const Definition& definition, TextureNode* node) {
    const ParameterList& parameters = definition.parameters;
    const std::string mapping = parameters.one_choice("mapping", "uv", {"uv", "spherical", "cylindrical", "planar"});
    if (mapping == "uv") {
        node->su = parameters.one_float("uscale", 1);
        node->sv = parameters.one_float("vscale", 1);
        node->du = parameters.one_float("udelta", 0);
        node->dv = parameters.one_float("vdelta", 0);
        return;
    }
    Mat4 space = world_to_texture(definition);
    node->mapping = mapping == "spherical" ? TextureMapping::kSpherical : TextureMapping::kCylindrical;
    if (mapping == "planar") {
        node->mapping = TextureMapping::kPlanar;
        space = planar_space(parameters, space);
    }
    node->space = add_space(context, space);
}

std::optional<TextureId> procedural_texture(Context* context, const Definition& definition, TextureUse use) {
    const ParameterList& parameters = definition.parameters;
    const std::string& kind = definition.kind;
    TextureNode node;
    if (kind == "checkerboard") {
        const int dimension = parameters.one_int("dimension", 2);
        if (dimension != 2 && dimension != 3)
            fail(parameters.where(), parameters.what() + ": \"integer dimension\" must be 2 or 3");
        node.kind = dimension == 2 ? TextureKind::kCheckerboard : TextureKind::kSolidCheckerboard;
        if (dimension == 2)
            read_mapping(context, definition, &node);
        else
            node.space = add_space(context, world_to_texture(definition));
        node.a = texture_operand(context, parameters, "tex1", use, 1);
        node.b = texture_operand(context, parameters, "tex2", use, 0);
        return add_node(context, node);
    }
    if (kind == "dots") {
        node.kind = TextureKind::kDots;
        read_mapping(context, definition, &node);
        node.a = texture_operand(context, parameters, "inside", use, 1);
        node.b = texture_operand(context, parameters, "outside", use, 0);
        return add_node(context, node);
    }
    if (kind != "fbm" && kind != "wrinkled" && kind != "windy" && kind != "marble") return std::nullopt;
    if ((kind == "marble") == (use == TextureUse::kFloat))
        fail(parameters.where(), parameters.what() + " exists as a " + (kind == "marble" ? "spectrum" : "float") +
                                     " texture only, as in pbrt; declare it as one");
    node.space = add_space(context, world_to_texture(definition));
    node.kind = kind == "fbm"        ? TextureKind::kFractal
                : kind == "wrinkled" ? TextureKind::kWrinkled
                : kind == "windy"    ? TextureKind::kWindy
                                     : TextureKind::kMarble;
    if (kind != "windy") read_octaves(parameters, &node);
    if (kind == "marble") {
        node.scale = parameters.one_float("scale", 1);
        node.variation = parameters.one_float("variation", 0.2f);
    }
    return add_node(context, node);
}

TextureRange noise_range(const TextureNode& node) {
    double last = 1;
    const double bound = double(kNoiseBound) * amplitudes(node, &last);
    if (node.kind == TextureKind::kFractal) return {-bound, bound};
    if (node.kind == TextureKind::kWrinkled) return {0.199 * last, bound + 0.201 * last};
    constexpr double kWindy = double(kNoiseBound) * 1.75 * double(kNoiseBound) * 1.96875;  // 3 and 6 octaves of 1, 1/2, 1/4 ...
    if (node.kind == TextureKind::kWindy) return {-kWindy, kWindy};
    return {};  // The range of a colour is never needed.
}

double noise_cost(const TextureNode& node) {
    return node.kind == TextureKind::kWindy ? 9 : node.kind == TextureKind::kDots ? 3 : double(node.octaves);
}

}  // namespace lightloom::import
