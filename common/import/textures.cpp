// Texture directives and texture-valued parameters become TextureNodes.

#include <algorithm>
#include <cmath>

#include "common/import/context.h"
#include "common/import/images.h"
#include "common/import/spectra.h"

namespace lightloom::import {
namespace {

/// Levels of nodes below a texture that a file may ask for; one more level is reserved for a material's own scale.
constexpr int kMaxNesting = 31;
/// Most nodes that one look-up may visit: textures that use another texture twice on every level double the number each
/// time.
constexpr double kMaxVisits = 4096;

/// The text of the file that a spectrum parameter names; `what` names the directive.
std::string read_spectrum_file(Context* context, const Parameter& p, const std::string& what) {
    const std::string& name = p.strings[0];
    const std::string given = what + ": " + quoted("spectrum " + p.name) + " is " + quoted(name);
    if (is_named_spectrum(name))
        fail(p.where, given + ", a spectrum that is known by name but not supported here; give its values or a file");
    const Result<std::string> path = context->files->resolve(name);
    if (!path.ok()) fail(p.where, given + ": " + path.status().message());
    Result<std::string> text = context->files->read(*path);
    if (text.ok()) return std::move(text).value();
    if (text.status().code() != StatusCode::kNotFound) fail(p.where, given + ": " + text.status().message());
    fail(p.where, given + ", which is neither a spectrum known by name nor a file below the scene's directory; correct it");
}

/// Reads a spectrum given by file, values or temperature; fails if there is none.
Spectrum read_spectrum(Context* context, const Parameter& p, const std::string& what) {
    if (p.type == "blackbody") return blackbody_spectrum(kelvin_of(p, what));
    if (!p.numbers.empty() && p.strings.empty()) {
        if (auto spectrum = spectrum_from_pairs(p.numbers)) return *spectrum;
        fail(p.where,
             what + ": the spectrum " + quoted(p.name) + " needs pairs of wavelength and value with increasing wavelengths");
    }
    if (p.strings.size() != 1 || !p.numbers.empty())
        fail(p.where, what + ": the spectrum " + quoted(p.name) + " needs one name, one file or pairs of numbers");
    const std::string text = read_spectrum_file(context, p, what);
    if (auto spectrum = parse_spectrum_text(text)) return *spectrum;
    fail(p.where, what + ": " + quoted(p.strings[0]) + " is not a spectrum file (pairs of increasing wavelength and value)");
}

Rgb colour_of(Context* context, const Parameter& p, const std::string& what, TextureUse use) {
    Rgb colour;
    if (p.type == "spectrum" && p.strings.size() == 1) {
        if (const std::optional<Rgb> index = named_index(p.strings[0])) {
            if (use == TextureUse::kReflectance)
                context->diagnostics.warn(p.where, what + ": " + quoted("spectrum " + p.name) + " is the index of refraction " +
                                                       quoted(p.strings[0]) +
                                                       "; as a reflectance it is taken per colour channel, not per wavelength");
            return *index;
        }
    }
    if (p.type == "rgb") {
        if (p.numbers.size() != 3) fail(p.where, what + ": " + quoted("rgb " + p.name) + " needs three numbers");
        colour = {float(p.numbers[0]), float(p.numbers[1]), float(p.numbers[2])};
    } else if (use == TextureUse::kReflectance) {
        // Values above 1 are reduced elsewhere: by a texture's scale, or in the end by the material.
        Spectrum spectrum = read_spectrum(context, p, what);
        double largest = 1;
        for (const SpectrumSample& sample : spectrum) largest = std::max(largest, sample.value);
        for (SpectrumSample& sample : spectrum) sample.value /= largest;
        colour = reflectance_rgb(spectrum) * float(largest);
    } else {
        colour = index_rgb(read_spectrum(context, p, what));
    }
    for (int c = 0; c < 3; ++c) {
        if (colour[c] < 0) fail(p.where, what + ": " + quoted(p.name) + " is negative");
        if (p.type == "rgb" && use == TextureUse::kReflectance && colour[c] > 1)
            fail(p.where, what + ": " + quoted(p.name) + " is above 1; a reflectance must lie in [0, 1]");
    }
    return colour;
}

void read_encoding(const ParameterList& parameters, const std::string& fallback, ImageRequest* request) {
    const std::string encoding = parameters.one_string("encoding", fallback);
    request->srgb = encoding == "sRGB";
    if (encoding == "sRGB" || encoding == "linear") return;
    double gamma = 0;
    if (encoding.rfind("gamma ", 0) != 0 || !parse_number(std::string_view(encoding).substr(6), &gamma) || !(gamma > 0) ||
        gamma > 100)
        fail(parameters.where(),
             parameters.what() + ": the encoding " + quoted(encoding) + " must be sRGB, linear or \"gamma VALUE\"");
    request->gamma = float(gamma);
}

TextureId image_texture(Context* context, const Definition& definition, TextureUse use) {
    const ParameterList& parameters = definition.parameters;
    TextureNode node;
    node.kind = TextureKind::kImage;
    read_mapping(context, definition, &node);
    node.scale = parameters.one_float("scale", 1);
    node.invert = parameters.one_bool("invert", false);
    node.non_negative = use != TextureUse::kFloat || node.invert;
    const std::string wrap = parameters.one_choice("wrap", "repeat", {"repeat", "clamp", "black"});
    node.wrap = wrap == "repeat" ? WrapMode::kRepeat : wrap == "clamp" ? WrapMode::kClamp : WrapMode::kBlack;
    const std::string filter = parameters.one_choice("filter", "bilinear", {"point", "bilinear", "trilinear", "EWA", "ewa"});
    node.nearest = filter == "point";
    if (filter != "point" && filter != "bilinear")
        context->diagnostics.warn(parameters.where(), parameters.what() + ": the filter " + quoted(filter) +
                                                          " becomes bilinear; samples average the rest");
    parameters.accept("float", "maxanisotropy");  // It belongs to the EWA filter only.
    const std::string reference = parameters.one_string("filename", "");
    if (reference.empty()) fail(parameters.where(), parameters.what() + " has no \"string filename\"");
    ImageRequest request;
    request.channels = use == TextureUse::kFloat ? ImageChannels::kScalar : ImageChannels::kColour;
    read_encoding(parameters, "sRGB", &request);
    if (!request.srgb && has_fixed_encoding(reference))
        context->diagnostics.warn(parameters.where(),
                                  parameters.what() + ": the encoding is ignored, as in pbrt: JPEG and TGA files are sRGB");
    node.image = context->load_image(parameters.where(), reference, request);
    return add_node(context, node);
}

TextureId make_texture(Context* context, const Definition& definition, TextureUse use) {
    const ParameterList& parameters = definition.parameters;
    TextureNode node;
    if (definition.kind == "constant") return texture_operand(context, parameters, "value", use, 1);
    if (definition.kind == "imagemap") return image_texture(context, definition, use);
    if (const auto id = procedural_texture(context, definition, use)) return *id;
    if (definition.kind == "scale") {
        node.kind = TextureKind::kScale;
        node.a = texture_operand(context, parameters, "tex", use, 1);
        node.b = texture_operand(context, parameters, "scale", TextureUse::kFloat, 1);
        return add_node(context, node);
    }
    if (definition.kind == "mix") {
        node.kind = TextureKind::kMix;
        node.a = texture_operand(context, parameters, "tex1", use, 0);
        node.b = texture_operand(context, parameters, "tex2", use, 1);
        node.amount = texture_operand(context, parameters, "amount", TextureUse::kFloat, 0.5f);
        return add_node(context, node);
    }
    fail(parameters.where(), parameters.what() +
                                 " is not supported; use constant, scale, mix, imagemap, checkerboard, dots, fbm, " +
                                 "wrinkled, windy or marble");
}

TextureRange hull(const TextureRange& a, const TextureRange& b) { return {std::fmin(a.least, b.least), std::fmax(a.most, b.most)}; }

TextureRange product(const TextureRange& a, const TextureRange& b) {
    const double corners[] = {a.least * b.least, a.least * b.most, a.most * b.least, a.most * b.most};
    TextureRange out{corners[0], corners[0]};
    for (const double corner : corners) out = hull(out, {corner, corner});
    return out;
}

/// Range of the pixels of a one-channel image. A float texture's pixels are floats even if the file has 8 bits
/// (ImageChannels::kScalar); bytes belong to grey pictures used as colours, whose range is never needed.
TextureRange range_of(const Image& image) {
    if (image.floats.empty()) return {0, 1};
    const auto [least, most] = std::minmax_element(image.floats.begin(), image.floats.end());
    return {double(*least), double(*most)};
}

/// Range of a node whose operands have been added.
TextureRange range_of(Context* context, const TextureNode& node) {
    const auto of = [&](TextureId id) { return context->texture_ranges[size_t(id)]; };
    switch (node.kind) {
        case TextureKind::kConstant: return {double(node.value.r), double(node.value.r)};
        case TextureKind::kCheckerboard:
        case TextureKind::kSolidCheckerboard:
        case TextureKind::kDots: return hull(of(node.a), of(node.b));
        case TextureKind::kScale: return product(of(node.a), of(node.b));
        case TextureKind::kMix: {
            const TextureRange t = of(node.amount);
            if (t.least >= 0 && t.most <= 1) return hull(of(node.a), of(node.b));
            const TextureRange a = product(of(node.a), {1 - t.most, 1 - t.least}), b = product(of(node.b), t);
            return {a.least + b.least, a.most + b.most};
        }
        case TextureKind::kImage: {
            const Image& image = context->scene.images[size_t(node.image)];
            if (image.channels != 1) return {};  // The range of colours is never needed.
            const auto [it, inserted] = context->image_ranges.try_emplace(node.image);
            if (inserted) it->second = range_of(image);
            TextureRange range = it->second;
            if (node.wrap == WrapMode::kBlack) range = hull(range, {0, 0});
            range = product(range, {double(node.scale), double(node.scale)});
            if (node.invert) range = {1 - range.most, 1 - range.least};
            return node.non_negative ? TextureRange{std::fmax(range.least, 0.0), std::fmax(range.most, 0.0)} : range;
        }
        case TextureKind::kFractal:
        case TextureKind::kWrinkled:
        case TextureKind::kWindy:
        case TextureKind::kMarble: return noise_range(node);
    }
    return {};
}

/// Marks a texture that is being resolved, so that cycles are found.
constexpr TextureId kInProgress = -2;

}  // namespace

TextureId named_texture(Context* context, const Location& where, const std::string& name, TextureUse use) {
    auto& resolved = context->resolved_textures;
    const bool is_float = use == TextureUse::kFloat;
    const auto& definitions = is_float ? context->float_textures : context->spectrum_textures;
    const auto& others = is_float ? context->spectrum_textures : context->float_textures;
    const std::string type = is_float ? "float" : "spectrum";
    if (const auto it = resolved.find({name, use}); it != resolved.end()) {
        if (it->second == kInProgress) fail(where, "the texture " + quoted(name) + " refers to itself");
        return it->second;
    }
    const auto it = definitions.find(name);
    if (it == definitions.end()) {
        fail(where, "no " + type + " texture is named " + quoted(name) +
                        (others.count(name) ? "; the texture of this name has the other type" : "; define it with Texture"));
    }
    if (resolved.size() > 300000) fail(where, "the scene has more than 300000 textures");
    resolved[{name, use}] = kInProgress;
    if (++context->texture_depth > kMaxNesting) fail(where, "textures refer to one another more than 31 levels deep");
    const TextureId id = context->resolve_or<TextureId>([&] { return constant_texture(context, Rgb(0.5f)); },
                                                        [&] {
                                                            const TextureId made = make_texture(context, it->second, use);
                                                            it->second.parameters.finish();
                                                            return made;
                                                        });
    --context->texture_depth;
    const TextureCost cost = context->texture_costs[size_t(id)];
    if (cost.levels > kMaxNesting) fail(where, "textures refer to one another more than 31 levels deep");
    if (cost.visits > kMaxVisits)
        fail(where, "the texture " + quoted(name) + " needs more than 4096 look-ups; use fewer textures in one another");
    resolved[{name, use}] = id;
    return id;
}

TextureId add_node(Context* context, const TextureNode& node) {
    TextureCost cost{1, 1 + noise_cost(node)};
    for (const TextureId child : {node.a, node.b, node.amount}) {
        if (child == kNone) continue;
        const TextureCost below = context->texture_costs[size_t(child)];
        cost.levels = std::max(cost.levels, below.levels + 1);
        cost.visits += below.visits;
    }
    context->texture_ranges.push_back(range_of(context, node));
    context->scene.textures.push_back(node);
    context->texture_costs.push_back(cost);
    return TextureId(context->scene.textures.size()) - 1;
}

TextureId constant_texture(Context* context, const Rgb& value) {
    const auto [it, inserted] = context->constants.try_emplace({value.r, value.g, value.b}, kNone);
    if (inserted) {
        TextureNode node;
        node.value = value;
        it->second = add_node(context, node);
    }
    return it->second;
}

TextureId float_texture_parameter(Context* context, const ParameterList& parameters, std::string_view name) {
    if (const Parameter* p = parameters.find("texture", name)) {
        if (p->strings.size() != 1) fail(p->where, parameters.what() + ": " + quoted(p->name) + " needs one texture name");
        return named_texture(context, p->where, p->strings[0], TextureUse::kFloat);
    }
    if (!parameters.find("float", name)) return kNone;
    return constant_texture(context, Rgb(parameters.one_float(name, 0)));
}

TextureId spectrum_texture_parameter(Context* context, const ParameterList& parameters, std::string_view name, TextureUse use) {
    if (const Parameter* p = parameters.find("texture", name)) {
        if (p->strings.size() != 1) fail(p->where, parameters.what() + ": " + quoted(p->name) + " needs one texture name");
        return named_texture(context, p->where, p->strings[0], use);
    }
    for (const std::string_view type : {"rgb", "spectrum", "blackbody"})
        if (const Parameter* p = parameters.find(type, name))
            return constant_texture(context, colour_of(context, *p, parameters.what(), use));
    return kNone;
}

double kelvin_of(const Parameter& p, const std::string& what) {
    if (p.numbers.size() != 1 || !(p.numbers[0] >= 100) || !(p.numbers[0] <= 1e6))
        fail(p.where, what + ": a black body needs one temperature between 100 and 1000000 kelvin");
    return p.numbers[0];
}

TextureId texture_operand(Context* context, const ParameterList& parameters, std::string_view name, TextureUse use,
                          float fallback) {
    const TextureId id = use == TextureUse::kFloat ? float_texture_parameter(context, parameters, name)
                                                   : spectrum_texture_parameter(context, parameters, name, use);
    return id == kNone ? constant_texture(context, Rgb(fallback)) : id;
}

std::optional<Spectrum> spectrum_parameter(Context* context, const ParameterList& parameters, std::string_view name) {
    const Parameter* p = parameters.find("spectrum", name);
    if (!p) return std::nullopt;
    return read_spectrum(context, *p, parameters.what());
}

}  // namespace lightloom::import
