#pragma once
// Texture evaluation and the resolution of a Material into a Bsdf at a surface point.

#include <span>

#include "common/scene/bsdf.h"
#include "common/scene/description.h"

namespace lightloom {

/// The tables that texture evaluation reads; views into a Scene or SceneDescription.
struct TextureTables {
    std::span<const TextureNode> nodes;
    std::span<const Image> images;
    std::span<const Material> materials;
    std::span<const Mat4> spaces = {};
};

/// Where a texture is looked up. A surface point has the same one whichever technique found it.
struct TexturePoint {
    Vec2 uv;  ///< The surface's parametrisation.
    Vec3 p;   ///< World space.
};

/// The purpose of a lookup in a colour texture. As in pbrt, an image gives a reflectance of at most 1 per texel lookup,
/// before other textures scale or mix it; refractive indices and float textures have no such bound.
enum class TextureUse { kUnbounded, kReflectance };

/// Value of a texture at a point. Nesting is bounded at import (at most 32 levels). For a pbrt v coordinate, image row 0 is
/// at v = 1. Never reads out of range.
Rgb evaluate_texture(const TextureTables& tables, TextureId id, const TexturePoint& at, TextureUse use = TextureUse::kUnbounded);

/// Resolves mixes: returns `material` itself unless it is a kMix, which is decided stochastically but reproducibly by
/// `choice` in [0, 1). The decision is part of the vertex, so that every technique that produces the same vertex sees
/// the same surface. kNone for mixes that lead nowhere.
MaterialId choose_material(const TextureTables& tables, MaterialId material, const TexturePoint& at, float choice);

/// Resolves `material` at a point; `choice` as in choose_material().
Bsdf resolve_material(const TextureTables& tables, MaterialId material, const TexturePoint& at, float choice);

}  // namespace lightloom
