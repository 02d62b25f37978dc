// Makes a Bsdf from a material and its textures at a point. Parameters that a material leaves unset have pbrt-v4's
// defaults.

#include "common/scene/texture.h"

namespace lightloom {
namespace {

Rgb value(const TextureTables& tables, TextureId id, const TexturePoint& at, const Rgb& fallback,
          TextureUse use = TextureUse::kUnbounded) {
    if (id == kNone) return fallback;
    const TextureNode& node = tables.nodes[size_t(id)];
    return node.kind == TextureKind::kConstant ? node.value : evaluate_texture(tables, id, at, use);
}

Rgb reflectance(const TextureTables& tables, TextureId id, const TexturePoint& at, const Rgb& fallback) {
    return value(tables, id, at, fallback, TextureUse::kReflectance);
}

float alpha(const TextureTables& tables, TextureId id, const TexturePoint& at, bool remap) {
    if (id == kNone) return 0;
    const float roughness = value(tables, id, at, Rgb(0)).r;
    return remap ? safe_sqrt(roughness) : roughness;
}

struct ConductorIndex {
    Rgb eta, k;
};

ConductorIndex conductor_index(const TextureTables& tables, const Material& m, const TexturePoint& at) {
    if (m.reflectance != kNone) return {Rgb(1), conductor_k(reflectance(tables, m.reflectance, at, Rgb(0)))};
    // The default is copper, at the wavelengths of the three primaries.
    return {value(tables, m.eta, at, Rgb(0.200f, 0.924f, 1.102f)), value(tables, m.k, at, Rgb(3.912f, 2.452f, 2.142f))};
}

}  // namespace

MaterialId choose_material(const TextureTables& tables, MaterialId material, const TexturePoint& at, float choice) {
    // Import bounds the nesting; a cycle that got past it ends as an absorber instead of hanging a worker.
    for (int level = 0; level < 32 && material != kNone; ++level) {
        const Material& m = tables.materials[size_t(material)];
        if (m.kind != MaterialKind::kMix) return material;
        const float amount = value(tables, m.mix_amount, at, Rgb(0.5f)).r;
        // `choice` is rescaled, so that it is uniform again for mixes inside mixes.
        if (choice < amount) {
            choice /= amount < 1 ? amount : 1.0f;
            material = m.mix_b;
        } else {
            choice = amount > 0 ? (choice - amount) / (1 - amount) : choice;
            material = m.mix_a;
        }
    }
    return kNone;
}

Bsdf resolve_material(const TextureTables& tables, MaterialId material, const TexturePoint& at, float choice) {
    const MaterialId chosen = choose_material(tables, material, at, choice);
    if (chosen == kNone) return {};
    const Material& m = tables.materials[size_t(chosen)];
    const float ior = m.ior > 0 ? m.ior : 1.0f;
    switch (m.kind) {
        case MaterialKind::kDiffuse: return make_diffuse(reflectance(tables, m.reflectance, at, Rgb(0.5f)));
        case MaterialKind::kDiffuseTransmission:
            return make_diffuse_transmission(reflectance(tables, m.reflectance, at, Rgb(0.25f)),
                                             reflectance(tables, m.transmittance, at, Rgb(0.25f)));
        case MaterialKind::kThinDielectric: return make_thin_dielectric(ior);
        case MaterialKind::kMix:  // choose_material() returns none
        case MaterialKind::kConductor:
        case MaterialKind::kDielectric:
        case MaterialKind::kCoatedDiffuse:
        case MaterialKind::kCoatedConductor: break;  // They have a roughness, which comes next.
    }
    const float alpha_x = alpha(tables, m.roughness_u, at, m.remap_roughness);
    const float alpha_y = m.roughness_v == m.roughness_u ? alpha_x : alpha(tables, m.roughness_v, at, m.remap_roughness);
    switch (m.kind) {
        case MaterialKind::kConductor: {
            const ConductorIndex index = conductor_index(tables, m, at);
            return make_conductor(index.eta, index.k, alpha_x, alpha_y);
        }
        case MaterialKind::kDielectric: return make_dielectric(ior, alpha_x, alpha_y);
        case MaterialKind::kCoatedDiffuse:
            return make_coated_diffuse(reflectance(tables, m.reflectance, at, Rgb(0.5f)), ior, m.thickness, alpha_x, alpha_y,
                                       (m.layer_events + 1) / 2);
        case MaterialKind::kCoatedConductor: {
            const ConductorIndex index = conductor_index(tables, m, at);
            return make_coated_conductor(index.eta, index.k, alpha(tables, m.base_roughness_u, at, m.remap_roughness),
                                         alpha(tables, m.base_roughness_v, at, m.remap_roughness), ior, m.thickness, alpha_x,
                                         alpha_y);
        }
        case MaterialKind::kMix:
        case MaterialKind::kDiffuse:
        case MaterialKind::kDiffuseTransmission:
        case MaterialKind::kThinDielectric: break;
    }
    return {};
}

}  // namespace lightloom
