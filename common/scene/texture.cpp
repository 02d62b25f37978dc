#include "common/scene/texture.h"

#include <algorithm>
#include <cmath>

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
    // As in pbrt, an image texture is never negative, whatever its scale or inversion.
    return {std::max(v.r, 0.0f), std::max(v.g, 0.0f), std::max(v.b, 0.0f)};
}

}  // namespace

Rgb evaluate_texture(const TextureTables& tables, TextureId id, const TexturePoint& at, TextureUse use) {
    const TextureNode& node = tables.nodes[size_t(id)];
    const Vec2 st{node.su * at.uv.x + node.du, node.sv * at.uv.y + node.dv};
    switch (node.kind) {
        case TextureKind::kConstant: return node.value;
        case TextureKind::kScale: return evaluate_texture(tables, node.a, at, use) * evaluate_texture(tables, node.b, at);
        case TextureKind::kMix: {
            const Rgb t = evaluate_texture(tables, node.amount, at);
            return evaluate_texture(tables, node.a, at, use) * (Rgb(1.0f) - t) + evaluate_texture(tables, node.b, at, use) * t;
        }
        case TextureKind::kCheckerboard: {
            if (!(std::fabs(st.x) < 1e9f && std::fabs(st.y) < 1e9f)) return evaluate_texture(tables, node.a, at, use);
            const int64_t cells = int64_t(std::floor(st.x)) + int64_t(std::floor(st.y));
            return evaluate_texture(tables, (cells & 1) == 0 ? node.a : node.b, at, use);
        }
        case TextureKind::kImage: {
            const Rgb v = image_value(node, tables.images[size_t(node.image)], st);
            if (use == TextureUse::kUnbounded) return v;
            return {std::min(v.r, 1.0f), std::min(v.g, 1.0f), std::min(v.b, 1.0f)};
        }
    }
    return {};
}

}  // namespace lightloom
