// Material directives become Materials, with pbrt-v4's defaults.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/import/context.h"
#include "common/import/images.h"
#include "common/import/spectra.h"

namespace lightloom::import {
namespace {

constexpr int kMaxMixDepth = 32;
/// Bound of the events of pbrt's random walk between the layers: no walk has nearly as many, and they can still be
/// counted one by one.
constexpr int kMaxLayerEvents = 10000;

TextureId spectrum_or(Context* context, const ParameterList& p, std::string_view name, float fallback) {
    const TextureId id = spectrum_texture_parameter(context, p, name, TextureUse::kReflectance);
    return id == kNone ? constant_texture(context, Rgb(fallback)) : id;
}

/// Parameter `name`, whether or not it is remapped to an alpha; kNone if absent. A number outside of [0, 1] in the file
/// is an error. A texture may give any value: above 1 it scatters as in pbrt-v4, except that a coat lets through as
/// much light as at 1, where its tables end; below 0, where pbrt computes with NaN, the surface is smooth.
TextureId roughness_parameter(Context* context, const ParameterList& p, const std::string& name) {
    const TextureId id = float_texture_parameter(context, p, name);
    if (id == kNone) return kNone;
    const TextureRange range = context->texture_ranges[size_t(id)];
    if (range.least >= 0 && range.most <= 1) return id;
    const Location& where = p.find_any(name)->where;
    char text[80];
    if (context->scene.textures[size_t(id)].kind == TextureKind::kConstant) {
        std::snprintf(text, sizeof text, " must lie in [0, 1], not be %g", range.least);
        fail(where, p.what() + ": " + name + text);
    }
    if (range.least == range.most)
        std::snprintf(text, sizeof text, " is %g", range.least);
    else
        std::snprintf(text, sizeof text, " may reach from %g to %g", range.least, range.most);
    context->diagnostics.warn(where, p.what() + ": " + name + text +
                                         ", beyond [0, 1]: below 0 it counts as 0, above 1 a coat lets light through as at 1");
    return id;
}

/// Reads `prefix`roughness, `prefix`uroughness and `prefix`vroughness.
void read_roughness(Context* context, const ParameterList& p, const std::string& prefix, float fallback, TextureId* u,
                    TextureId* v) {
    TextureId both = roughness_parameter(context, p, prefix + "roughness");
    if (both == kNone) both = constant_texture(context, Rgb(fallback));
    *u = roughness_parameter(context, p, prefix + "uroughness");
    *v = roughness_parameter(context, p, prefix + "vroughness");
    if (*u == kNone) *u = both;
    if (*v == kNone) *v = both;
}

/// Reads an index of refraction given as float, named glass, or spectrum; it must be positive.
float read_index(Context* context, const ParameterList& p, std::string_view name) {
    float index = p.one_float(name, 1.5f);
    if (const Parameter* s = p.find("spectrum", name)) {
        std::optional<float> glass;
        if (s->strings.size() == 1) glass = named_glass(s->strings[0]);
        index = glass ? *glass : float(evaluate(*spectrum_parameter(context, p, name), 587.6));
        context->diagnostics.warn(s->where, p.what() + ": the dispersion of " + quoted(s->name) +
                                                " is ignored: its index at 587.6 nm is used for all colours");
    }
    if (!(index > 0) || !(index < 100)) fail(p.where(), p.what() + ": the index of refraction must lie between 0 and 100");
    return index;
}

/// Reads the reflectance, or eta and k, of a conductor; `prefix` is "" or "conductor.".
void read_conductor(Context* context, const ParameterList& p, const std::string& prefix, Material* m) {
    m->reflectance = spectrum_texture_parameter(context, p, "reflectance", TextureUse::kReflectance);
    const std::string eta_name = prefix + "eta", k_name = prefix + "k";
    if (m->reflectance != kNone) {
        for (const std::string_view name : {eta_name, k_name})
            for (const std::string_view type : {"rgb", "spectrum", "blackbody", "texture"})
                if (p.find(type, name))
                    fail(p.where(), p.what() + ": give either reflectance or " + eta_name + " and " + k_name + ", not both");
        return;
    }
    const Parameter *eta = p.find("spectrum", eta_name), *k = p.find("spectrum", k_name);
    const auto is_named = [](const Parameter* s) { return s && s->strings.size() == 1 && named_index(s->strings[0]); };
    // A metal's eta and k are reduced together, see spectra.h; for named metals this has been done.
    if (eta && k && !is_named(eta) && !is_named(k)) {
        const ConductorRgb both = conductor_rgb(*spectrum_parameter(context, p, eta_name), *spectrum_parameter(context, p, k_name));
        m->eta = constant_texture(context, both.eta);
        m->k = constant_texture(context, both.k);
    }
    if (m->eta == kNone) m->eta = spectrum_texture_parameter(context, p, eta_name, TextureUse::kUnbounded);
    if (m->k == kNone) m->k = spectrum_texture_parameter(context, p, k_name, TextureUse::kUnbounded);
    // pbrt's default is copper for either. A parameter of the wrong type is reported by finish(), unless it is an
    // Attribute's default, which may suit another kind of material.
    if (m->eta == kNone) m->eta = constant_texture(context, named_metal("metal-Cu")->eta);
    if (m->k == kNone) m->k = constant_texture(context, named_metal("metal-Cu")->k);
}

void read_layers(Context* context, const ParameterList& p, Material* m) {
    Diagnostics* d = &context->diagnostics;
    m->thickness = p.one_float("thickness", m->thickness);
    if (!(m->thickness >= 0)) fail(p.where(), p.what() + ": the thickness is negative");
    const auto count = [&](std::string_view name, int fallback) {
        const int value = p.one_int(name, fallback);
        if (value < 1 || value > kMaxLayerEvents)
            fail(p.where(), p.what() + ": " + std::string(name) + " must lie between 1 and " + std::to_string(kMaxLayerEvents) +
                                ", not " + std::to_string(value));
        return value;
    };
    const int events = count("maxdepth", m->layer_events);
    count("nsamples", 1);
    if (m->kind == MaterialKind::kCoatedDiffuse)
        m->layer_events = events;
    else
        p.ignore(d, "maxdepth", "the layers here are joined analytically, without a random walk");
    p.ignore(d, "nsamples", "the layers here are joined analytically, without a random walk");
    for (const std::string_view declaration : {"rgb albedo", "spectrum albedo", "texture albedo", "float g", "texture g"}) {
        const size_t space = declaration.find(' ');
        const Parameter* medium = p.find(declaration.substr(0, space), declaration.substr(space + 1));
        const auto is_zero = [](double v) { return v == 0; };
        // A texture or a named spectrum has no numbers.
        if (medium && (medium->numbers.empty() || medium->type == "spectrum" ||
                       !std::all_of(medium->numbers.begin(), medium->numbers.end(), is_zero)))
            fail(medium->where, p.what() + ": " + quoted(medium->type + " " + medium->name) +
                                    " is not supported, the medium between the layers is not modelled; set it to 0 or "
                                    "remove it, or render with --without media");
    }
}

void read_mix(Context* context, const ParameterList& p, Material* m) {
    const Parameter* names = p.find("string", "materials");
    if (!names || names->strings.size() != 2) fail(p.where(), p.what() + " needs \"string materials\" with two names");
    if (++context->material_depth > kMaxMixDepth)
        fail(p.where(), p.what() + ": mix materials refer to one another more than 32 levels deep");
    m->mix_a = resolve_material_reference(context, {true, names->strings[0], 0, names->where});
    m->mix_b = resolve_material_reference(context, {true, names->strings[1], 0, names->where});
    --context->material_depth;
    const int levels = 1 + std::max(context->mix_levels[m->mix_a], context->mix_levels[m->mix_b]);
    if (levels > kMaxMixDepth) fail(p.where(), p.what() + ": mix materials refer to one another more than 32 levels deep");
    if (m->mix_a == kInterfaceMaterial || m->mix_b == kInterfaceMaterial)
        fail(p.where(), p.what() + ": a mix with an \"interface\" material is not supported; use the shape's alpha instead");
    m->mix_amount = float_texture_parameter(context, p, "amount");
    if (m->mix_amount == kNone) m->mix_amount = constant_texture(context, Rgb(0.5f));
}

void read_bump(Context* context, const ParameterList& p, Material* m) {
    const std::string reference = p.one_string("normalmap", "");
    if (reference.empty()) {
        m->displacement = float_texture_parameter(context, p, "displacement");
        return;
    }
    p.ignore(&context->diagnostics, "displacement", "beside a normal map it is not used, as in pbrt");
    const Location& where = p.find("string", "normalmap")->where;
    if (has_fixed_encoding(reference))
        context->diagnostics.warn(where, p.what() + ": the normals of " + quoted(reference) +
                                             " are decoded as sRGB, as in pbrt, which takes JPEG and TGA files for nothing else; "
                                             "convert it to PNG");
    ImageRequest request;
    request.srgb = false;
    TextureNode node;
    node.kind = TextureKind::kImage;
    node.image = context->load_image(where, reference, request);
    if (context->scene.images[size_t(node.image)].channels != 3)
        fail(where, p.what() + ": the normal map " + quoted(reference) + " has no red, green and blue channels");
    m->normal_map = add_node(context, node);
}

/// Index of the new material, or kInterfaceMaterial.
MaterialId make_material(Context* context, const std::string& name, const Definition& definition) {
    const ParameterList& p = definition.parameters;
    const std::string& kind = definition.kind;
    p.accept("string", "type");
    Material m;
    m.name = name;
    m.remap_roughness = true;
    if (kind == "interface" || kind == "none" || kind.empty()) {
        for (const std::string_view map : {"displacement", "normalmap"})
            p.ignore(&context->diagnostics, map, "a shape of this material has no surface");
        p.finish();
        return kInterfaceMaterial;
    }
    if (kind == "diffuse") {
        m.kind = MaterialKind::kDiffuse;
        m.reflectance = spectrum_or(context, p, "reflectance", 0.5f);
    } else if (kind == "diffusetransmission") {
        m.kind = MaterialKind::kDiffuseTransmission;
        m.reflectance = spectrum_or(context, p, "reflectance", 0.25f);
        m.transmittance = spectrum_or(context, p, "transmittance", 0.25f);
        const float scale = p.one_float("scale", 1);
        if (!(scale >= 0)) fail(p.where(), p.what() + ": the scale is negative");
        if (scale != 1)
            for (TextureId* id : {&m.reflectance, &m.transmittance}) {
                TextureNode node;
                node.kind = TextureKind::kScale;
                node.a = *id;
                node.b = constant_texture(context, Rgb(scale));
                *id = add_node(context, node);
            }
    } else if (kind == "conductor") {
        m.kind = MaterialKind::kConductor;
        read_conductor(context, p, "", &m);
        read_roughness(context, p, "", 0, &m.roughness_u, &m.roughness_v);
        m.remap_roughness = p.one_bool("remaproughness", true);
    } else if (kind == "dielectric") {
        m.kind = MaterialKind::kDielectric;
        m.ior = read_index(context, p, "eta");
        read_roughness(context, p, "", 0, &m.roughness_u, &m.roughness_v);
        m.remap_roughness = p.one_bool("remaproughness", true);
    } else if (kind == "thindielectric") {
        m.kind = MaterialKind::kThinDielectric;
        m.ior = read_index(context, p, "eta");
    } else if (kind == "coateddiffuse") {
        m.kind = MaterialKind::kCoatedDiffuse;
        m.reflectance = spectrum_or(context, p, "reflectance", 0.5f);
        m.ior = read_index(context, p, "eta");
        read_roughness(context, p, "", 0, &m.roughness_u, &m.roughness_v);
        m.remap_roughness = p.one_bool("remaproughness", true);
        read_layers(context, p, &m);
    } else if (kind == "coatedconductor") {
        m.kind = MaterialKind::kCoatedConductor;
        read_conductor(context, p, "conductor.", &m);
        m.ior = read_index(context, p, "interface.eta");
        read_roughness(context, p, "interface.", 0, &m.roughness_u, &m.roughness_v);
        read_roughness(context, p, "conductor.", 0, &m.base_roughness_u, &m.base_roughness_v);
        m.remap_roughness = p.one_bool("remaproughness", true);
        read_layers(context, p, &m);
    } else if (kind == "mix") {
        m.kind = MaterialKind::kMix;
        read_mix(context, p, &m);
        constexpr const char* kElsewhere = "a mix is one of its materials at every point; give it to those";
        p.ignore(&context->diagnostics, "normalmap", kElsewhere);  // pbrt ignores it, too, and refuses displacement
        p.refuse("displacement", kElsewhere);
    } else {
        fail(p.where(), p.what() + ": the material " + quoted(kind) +
                            " is not supported; use diffuse, diffusetransmission, conductor, dielectric, "
                            "thindielectric, coateddiffuse, coatedconductor, mix or interface");
    }
    if (m.kind != MaterialKind::kMix) read_bump(context, p, &m);
    p.finish();
    const MaterialId id = MaterialId(context->scene.materials.size());
    if (m.kind == MaterialKind::kMix)
        context->mix_levels[id] = 1 + std::max(context->mix_levels[m.mix_a], context->mix_levels[m.mix_b]);
    context->scene.materials.push_back(std::move(m));
    return id;
}

/// Where faults are collected, a material that cannot be made is replaced by a diffuse one.
MaterialId make_or_stand_in(Context* context, const std::string& name, const Definition& definition) {
    const auto stand_in = [&] {
        Material m;
        m.kind = MaterialKind::kDiffuse;
        m.reflectance = constant_texture(context, Rgb(0.5f));
        context->scene.materials.push_back(std::move(m));
        return MaterialId(context->scene.materials.size() - 1);
    };
    return context->resolve_or<MaterialId>(stand_in, [&] { return make_material(context, name, definition); });
}

}  // namespace

MaterialId resolve_material_reference(Context* context, const MaterialReference& reference) {
    constexpr MaterialId kInProgress = -3;
    if (!reference.named) {
        const auto [it, inserted] = context->resolved_anonymous_materials.try_emplace(reference.anonymous, kNone);
        if (inserted) it->second = make_or_stand_in(context, "", context->anonymous_materials[size_t(reference.anonymous)]);
        return it->second;
    }
    const std::string& name = reference.name;
    if (const auto it = context->resolved_named_materials.find(name); it != context->resolved_named_materials.end()) {
        if (it->second == kInProgress) fail(reference.where, "the material " + quoted(name) + " refers to itself");
        return it->second;
    }
    const auto it = context->named_materials.find(name);
    if (it == context->named_materials.end())
        fail(reference.where, "no material is named " + quoted(name) + "; define it with MakeNamedMaterial");
    context->resolved_named_materials[name] = kInProgress;
    const MaterialId id = make_or_stand_in(context, name, it->second);
    context->resolved_named_materials[name] = id;
    return id;
}

}  // namespace lightloom::import
