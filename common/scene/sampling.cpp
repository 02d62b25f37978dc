#include "common/scene/sampling.h"

#include <cmath>

namespace lightloom {

AliasTable::AliasTable(std::span<const double> weights) : entries_(weights.size()) { make_alias(weights, entries_.data()); }

void make_alias(std::span<const double> weights, AliasEntry* entries) {
    const size_t n = weights.size();
    double sum = 0;
    for (const double w : weights) sum += w;
    std::vector<double> scaled(n);
    std::vector<uint32_t> small, large;
    for (uint32_t i = 0; i < n; ++i) {
        const double p = sum > 0 ? weights[i] / sum : 1.0 / double(n);
        scaled[i] = p * double(n);
        entries[i] = {float(p), 1, i};
        (scaled[i] < 1 ? small : large).push_back(i);
    }
    while (!small.empty() && !large.empty()) {
        const uint32_t s = small.back(), l = large.back();
        small.pop_back();
        entries[s].keep = float(scaled[s]);
        entries[s].alias = l;
        scaled[l] -= 1 - scaled[s];
        if (scaled[l] < 1) {
            large.pop_back();
            small.push_back(l);
        }
    }
    // Rounding can leave an index of weight zero here. It must never be drawn, so that its part goes to another index.
    for (const uint32_t i : small)
        if (entries[i].pmf == 0) {
            uint32_t j = 0;
            while (entries[j].pmf == 0) ++j;
            entries[i].keep = 0;
            entries[i].alias = j;
        }
}

uint32_t AliasTable::sample(double u, float* remapped) const {
    const uint32_t i = alias_part(uint32_t(entries_.size()), u);
    const double f = u * double(entries_.size()) - double(i);
    const AliasEntry& entry = entries_[i];
    const double keep = entry.keep;
    const bool own = f < keep;
    if (remapped != nullptr) {
        const double r = own ? f / keep : (f - keep) / (1 - keep);
        *remapped = r < 0x1.fffffep-1 ? float(r) : 0x1.fffffep-1f;
    }
    return own ? i : entry.alias;
}

Vec2 sample_disk(Vec2 u) {
    const float a = 2 * u.x - 1, b = 2 * u.y - 1;
    if (a == 0 && b == 0) return {0, 0};
    if (a * a > b * b) {
        const math::SinCos sc = math::sincos_reduced(0.78539816339744830962 * (double(b) / a));
        return {a * float(sc.cos), a * float(sc.sin)};
    }
    const math::SinCos sc = math::sincos_reduced(0.78539816339744830962 * (double(a) / b));
    return {b * float(sc.sin), b * float(sc.cos)};
}

Vec3 sample_sphere(Vec2 u) {
    const float z = 1 - 2 * u.x;
    const float r = safe_sqrt(1 - z * z);
    const math::SinCos sc = math::sincos_turns(u.y);
    return {r * float(sc.cos), r * float(sc.sin), z};
}

Vec3 sample_cosine_hemisphere_concentric(Vec2 u) {
    const Vec2 d = sample_disk(u);
    return {d.x, d.y, safe_sqrt(1 - d.x * d.x - d.y * d.y)};
}

Vec2 sample_triangle(Vec2 u) {
    // This folds the square onto the triangle without a square root [Heitz 2019, A Low-Distortion Map Between Triangle
    // and Square].
    if (u.y > u.x) {
        const float x = u.x * 0.5f;
        return {x, u.y - x};
    }
    const float y = u.y * 0.5f;
    return {u.x - y, y};
}

std::vector<double> projected_solid_angles(int columns, int rows, double half_width, double half_height) {
    // Signed solid angle of the rectangle from the axis to (x, y); a cell's is the sum over its corners.
    const auto to_corner = [](double x, double y) { return math::atan(x * y / std::sqrt(1 + x * x + y * y)); };
    std::vector<double> above(size_t(columns) + 1), below(above.size()), out;
    const auto fill = [&](std::vector<double>& line, int row) {
        for (int i = 0; i <= columns; ++i)
            line[size_t(i)] = to_corner(half_width * (2.0 * i / columns - 1), half_height * (1 - 2.0 * row / rows));
    };
    out.reserve(size_t(columns) * size_t(rows));
    fill(above, 0);
    for (int row = 0; row < rows; ++row) {
        fill(below, row + 1);
        for (size_t i = 0; i < size_t(columns); ++i)
            out.push_back(std::fmax(above[i + 1] - above[i] - below[i + 1] + below[i], 0.0));
        above.swap(below);
    }
    return out;
}

Vec3 equal_area_square_to_sphere(Vec2 p) {
    const double u = 2.0 * p.x - 1, v = 2.0 * p.y - 1;
    const double up = std::fabs(u), vp = std::fabs(v);
    // Signed distance along the diagonal: positive in the upper hemisphere.
    const double signed_distance = 1 - (up + vp);
    const double d = std::fabs(signed_distance);
    const double r = 1 - d;
    const double phi = (r == 0 ? 1.0 : (vp - up) / r + 1) * (kPiD / 4);
    const double z = std::copysign(1 - r * r, signed_distance);
    const math::SinCos sc = math::sincos(phi);
    const double scale = r * std::sqrt(std::fmax(0, 2 - r * r));
    return {float(std::copysign(sc.cos * scale, u)), float(std::copysign(sc.sin * scale, v)), float(z)};
}

Vec2 equal_area_sphere_to_square(const Vec3& d) {
    const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z);
    const double r = std::sqrt(std::fmax(0, 1 - z));
    const double a = std::fmax(x, y), b = std::fmin(x, y);
    double phi = a == 0 ? 0 : math::atan(b / a) * (2 / kPiD);
    if (x < y) phi = 1 - phi;
    double v = phi * r, u = r - v;
    if (d.z < 0) {
        const double t = u;
        u = 1 - v;
        v = 1 - t;
    }
    u = std::copysign(u, double(d.x));
    v = std::copysign(v, double(d.y));
    return {float((u + 1) * 0.5), float((v + 1) * 0.5)};
}

}  // namespace lightloom
