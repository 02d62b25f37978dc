#include "common/scene/environment.h"

#include <algorithm>

#include "common/core/math.h"

namespace lightloom {
namespace {

int texel_of(float c, int n) { return std::clamp(int(c * float(n)), 0, n - 1); }

}  // namespace

Environment::Environment(const std::vector<InfiniteLight>& lights, const std::vector<Image>& images) {
    std::vector<double> powers;
    for (const InfiniteLight& light : lights) {
        Part part;
        part.to_world = light.light_to_world;
        for (int i = 0; i < 3; ++i) part.to_world.m[i][3] = 0;
        part.to_light = *inverse(part.to_world);  // Scene::build() has refused singular ones
        part.scale = light.radiance;
        double power = 4 * kPiD * scalar_of(light.radiance);
        if (light.image != kNone) {
            part.image = &images[size_t(light.image)];
            const int w = part.image->width, h = part.image->height;
            // Texels have equal areas and constant radiance (point lookup, as pbrt does), so that the table is exactly
            // proportional.
            std::vector<double> weights(size_t(w) * size_t(h));
            double sum = 0;
            for (int y = 0; y < h; ++y)
                for (int x = 0; x < w; ++x)
                    sum += weights[size_t(y) * size_t(w) + size_t(x)] = scalar_of(part.image->texel(x, y) * part.scale);
            power = sum * 4 * kPiD / double(weights.size());
            part.texels = AliasTable(weights);
        }
        powers.push_back(power);
        total_ += power;
        parts_.push_back(std::move(part));
    }
    pick_ = AliasTable(powers);
    for (size_t i = 0; i < parts_.size(); ++i) parts_[i].pmf = pick_.pmf(i);
}

Rgb Environment::radiance(const Vec3& d) const {
    Rgb sum;
    for (const Part& part : parts_) {
        if (part.image == nullptr) {
            sum += part.scale;
            continue;
        }
        const Vec2 uv = equal_area_sphere_to_square(normalize(part.to_light.vector(d)));
        sum += part.scale * part.image->texel(texel_of(uv.x, part.image->width), texel_of(uv.y, part.image->height));
    }
    return sum;
}

float Environment::pdf_solid_angle(const Vec3& d) const {
    float pdf = 0;
    for (const Part& part : parts_) {
        if (part.image == nullptr) {
            pdf += part.pmf * kInvFourPi;
            continue;
        }
        const Vec2 uv = equal_area_sphere_to_square(normalize(part.to_light.vector(d)));
        const int w = part.image->width, h = part.image->height;
        const size_t texel = size_t(texel_of(uv.y, h)) * size_t(w) + size_t(texel_of(uv.x, w));
        pdf += part.pmf * part.texels.pmf(texel) * float(part.texels.size()) * kInvFourPi;
    }
    return pdf;
}

Vec3 Environment::sample(float pick, Vec2 u) const {
    float rest = 0;
    const Part& part = parts_[pick_.sample(pick, &rest)];
    if (part.image == nullptr) return normalize(part.to_world.vector(sample_sphere(u)));
    // One uniform number chooses the texel; its remainder and the second number choose the direction inside it.
    float inside = 0;
    const uint32_t texel = part.texels.sample(double(u.x) + double(rest) * 0x1p-24, &inside);
    const int w = part.image->width, h = part.image->height;
    const Vec2 uv{(float(texel % uint32_t(w)) + inside) / float(w), (float(texel / uint32_t(w)) + u.y) / float(h)};
    return normalize(part.to_world.vector(equal_area_square_to_sphere(uv)));
}

}  // namespace lightloom
