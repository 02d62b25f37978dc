#include "common/scene/texture.h"

#include <algorithm>
#include <cmath>

#include "common/core/math.h"
#include "common/scene/noise.h"

namespace lightloom {
namespace {

int wrapped(int64_t i, int n, WrapMode mode, bool* black) {
    if (i >= 0 && i < n) return int(i);
    if (mode == WrapMode::kClamp) return i < 0 ? 0 : n - 1;
    if (mode == WrapMode::kBlack) {
        *black = true;
        return 0;
    }
    const int64_t m = i % n;
    return int(m < 0 ? m + n : m);
}

Rgb texel(const Image& image, int64_t x, int64_t y, WrapMode mode) {
    bool black = false;
    const int ix = wrapped(x, image.width, mode, &black), iy = wrapped(y, image.height, mode, &black);
    return black ? Rgb{} : image.texel(ix, iy);
}

Rgb image_value(const TextureNode& node, const Image& image, Vec2 st) {
    const float x = st.x * float(image.width), y = (1 - st.y) * float(image.height);
    if (!(std::fabs(x) < 1e9f && std::fabs(y) < 1e9f)) return {};
    Rgb v;
    if (node.nearest) {
        v = texel(image, int64_t(std::floor(x)), int64_t(std::floor(y)), node.wrap);
    } else {
        const float fx = std::floor(x - 0.5f), fy = std::floor(y - 0.5f);
        const float dx = x - 0.5f - fx, dy = y - 0.5f - fy;
        const int64_t ix = int64_t(fx), iy = int64_t(fy);
        v = (texel(image, ix, iy, node.wrap) * (1 - dx) + texel(image, ix + 1, iy, node.wrap) * dx) * (1 - dy) +
            (texel(image, ix, iy + 1, node.wrap) * (1 - dx) + texel(image, ix + 1, iy + 1, node.wrap) * dx) * dy;
    }
    v *= node.scale;
    if (node.invert) v = Rgb(1.0f) - v;
    if (!node.non_negative) return v;
    return {std::max(v.r, 0.0f), std::max(v.g, 0.0f), std::max(v.b, 0.0f)};
}

/// Beyond this the parity of a cell carries no information.
bool has_cells(float x) { return std::fabs(x) < 1e9f; }

int64_t cell(float x) { return int64_t(std::floor(x)); }

Vec3 in_space(const TextureTables& tables, const TextureNode& node, const TexturePoint& at) {
    return tables.spaces[size_t(node.space)].point(at.p);
}

Vec2 mapped(const TextureTables& tables, const TextureNode& node, const TexturePoint& at) {
    if (node.mapping == TextureMapping::kUv) return {node.su * at.uv.x + node.du, node.sv * at.uv.y + node.dv};
    const Vec3 p = in_space(tables, node, at);
    if (node.mapping == TextureMapping::kPlanar) return {p.x, p.y};
    const double azimuth = math::atan2(p.y, p.x) / (2 * kPiD);
    if (node.mapping == TextureMapping::kCylindrical) return {float(0.5 + azimuth), p.z};
    const double across = std::sqrt(double(p.x) * p.x + double(p.y) * p.y);
    return {float(math::atan2(across, p.z) / kPiD), float(azimuth < 0 ? azimuth + 1 : azimuth)};
}

}  // namespace

Rgb evaluate_texture(const TextureTables& tables, TextureId id, const TexturePoint& at, TextureUse use) {
    const TextureNode& node = tables.nodes[size_t(id)];
    switch (node.kind) {
        case TextureKind::kConstant: return node.value;
        case TextureKind::kScale: return evaluate_texture(tables, node.a, at, use) * evaluate_texture(tables, node.b, at);
        case TextureKind::kMix: {
            const Rgb t = evaluate_texture(tables, node.amount, at);
            return evaluate_texture(tables, node.a, at, use) * (Rgb(1.0f) - t) + evaluate_texture(tables, node.b, at, use) * t;
        }
        case TextureKind::kCheckerboard: {
            const Vec2 st = mapped(tables, node, at);
            if (!(has_cells(st.x) && has_cells(st.y))) return evaluate_texture(tables, node.a, at, use);
            const int64_t cells = cell(st.x) + cell(st.y);
            return evaluate_texture(tables, (cells & 1) == 0 ? node.a : node.b, at, use);
        }
        case TextureKind::kImage: {
            const Rgb v = image_value(node, tables.images[size_t(node.image)], mapped(tables, node, at));
            if (use == TextureUse::kUnbounded) return v;
            return {std::min(v.r, 1.0f), std::min(v.g, 1.0f), std::min(v.b, 1.0f)};
        }
        case TextureKind::kSolidCheckerboard: {
            const Vec3 p = in_space(tables, node, at);
            const bool odd = has_cells(p.x) && has_cells(p.y) && has_cells(p.z) && ((cell(p.x) + cell(p.y) + cell(p.z)) & 1) != 0;
            return evaluate_texture(tables, odd ? node.b : node.a, at, use);
        }
        case TextureKind::kDots: return evaluate_texture(tables, inside_dot(mapped(tables, node, at)) ? node.a : node.b, at, use);
        case TextureKind::kFractal: return Rgb(fractal_noise(in_space(tables, node, at), node.omega, node.octaves));
        case TextureKind::kWrinkled: return Rgb(turbulence(in_space(tables, node, at), node.omega, node.octaves));
        case TextureKind::kWindy: {
            const Vec3 p = in_space(tables, node, at);
            return Rgb(std::fabs(fractal_noise(p * 0.1f, 0.5f, 3)) * fractal_noise(p, 0.5f, 6));
        }
        case TextureKind::kMarble: return marble(in_space(tables, node, at) * node.scale, node.omega, node.octaves, node.variation);
    }
    return {};
}

}  // namespace lightloom
