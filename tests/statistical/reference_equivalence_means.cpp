// Estimates and intervals of `reference_equivalence`.

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "common/import/import.h"
#include "tests/statistical/reference_equivalence.h"

namespace lightloom::equivalence {

double normal_quantile(double upper_tail) {
    double lo = 0, hi = 40;
    for (int i = 0; i < 200; ++i) {
        const double mid = (lo + hi) / 2;
        (0.5 * std::erfc(mid / std::sqrt(2.0)) > upper_tail ? lo : hi) = mid;
    }
    return lo;
}

double sidak_factor(size_t tests) { return normal_quantile(0.5 * (1 - std::pow(0.95, 1.0 / double(tests)))); }

Interval ratio_interval(const Mean& m, double reference, double relative_reference_error, double z) {
    const double ratio = m.mean() / reference;
    const double error = std::hypot(m.standard_error() / reference, ratio * relative_reference_error);
    return {ratio, ratio - z * error, ratio + z * error};
}

Interval ratio_interval(const Mean& a, const Mean& b, double z) {
    return ratio_interval(a, b.mean(), b.standard_error() / b.mean(), z);
}

PartMeans part_means(const RgbImage& image) {
    PartMeans means(kParts, 0.0);
    std::vector<double> count(kParts, 0.0);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const float* p = &image.pixels[(size_t(y) * size_t(image.width) + size_t(x)) * 3];
            const double luminance = 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
            const int region = kFirstRegion + (y * 3 / image.height) * 3 + x * 3 / image.width;
            const auto add = [&](int part, double value) { means[size_t(part)] += value, ++count[size_t(part)]; };
            add(kImage, luminance);
            add(region, luminance);
            for (int c = 0; c < 3; ++c) add(kFirstChannel + c, p[c]);
        }
    for (size_t part = 0; part < means.size(); ++part) means[part] /= count[part];
    return means;
}

Result<Estimate> estimate(const Scene& scene, const RenderGroup& render, double seconds,
                          const std::function<bool(const Estimate&)>& settled) {
    constexpr uint32_t kIterations = 2, kLeastGroups = 16;
    const FrameLayout frame = scene.frame();
    const float exposure = scene.description().film.exposure_scale;
    Accumulation total(frame);
    Estimate result;
    const auto start = std::chrono::steady_clock::now();
    for (uint32_t group = 0;; ++group) {
        const UnitWork work{uint64_t(group) * kIterations, kIterations, group, frame.crop, 0,
                            uint64_t(kIterations) * uint64_t(frame.crop.area())};
        auto partial = render(work);
        if (!partial.ok()) return partial.status();
        GroupSum sum(frame);
        Accumulation alone(frame);
        LL_RETURN_IF_ERROR(sum.add(*partial));
        LL_RETURN_IF_ERROR(alone.fold(sum, kIterations));
        LL_RETURN_IF_ERROR(total.fold(sum, kIterations));
        const PartMeans means = part_means(alone.develop(exposure));
        for (size_t part = 0; part < means.size(); ++part) result.parts[part].add(means[part]);
        result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (group + 1 >= kLeastGroups && (result.seconds >= seconds || settled(result))) break;
    }
    result.iterations = total.iterations();
    result.dropped = total.dropped();
    result.picture = total.develop(exposure);
    return result;
}

Result<LoadedScene> load_scene(const Options& options, const std::string& name, const std::string& resolution,
                               float hittable_radius) {
    auto imported = import_pbrt(options.shared + "/scenes/" + name + "/scene.pbrt");
    if (!imported.ok()) return imported.status();
    SceneDescription& description = imported->description;
    SceneOptions scene_options;
    if (!resolution.empty() && std::sscanf(resolution.c_str(), "%dx%d", &scene_options.width, &scene_options.height) != 2)
        return invalid_argument(name + ": the resolution " + resolution + " is not WIDTHxHEIGHT");
    if (hittable_radius > 0) {
        TextureNode black;
        description.textures.push_back(black);
        Material dark;
        dark.kind = MaterialKind::kDiffuse;
        dark.reflectance = TextureId(description.textures.size()) - 1;
        description.materials.push_back(dark);
        for (const PointLight& light : description.point_lights) {
            // A sphere of radiance L looks like a disc of intensity L pi r^2 from everywhere.
            description.emissions.push_back({light.intensity * (kInvPi / (hittable_radius * hittable_radius)), false});
            Sphere sphere;
            sphere.centre = light.position;
            sphere.radius = hittable_radius;
            sphere.attributes.material = MaterialId(description.materials.size()) - 1;
            sphere.attributes.emission = int32_t(description.emissions.size()) - 1;
            description.spheres.push_back(sphere);
        }
        description.point_lights.clear();
    }
    LoadedScene loaded;
    loaded.max_depth = description.max_depth;
    auto built = Scene::build(std::move(description), scene_options);
    if (!built.ok()) return built.status();
    loaded.scene = std::move(built).value();
    return loaded;
}

Result<RenderGroup> catalog_group(const LoadedScene& loaded, const std::string& algorithm, uint64_t seed) {
    RenderSettings settings;
    settings.algorithm = algorithm;
    settings.max_depth = loaded.max_depth;
    settings.seed = seed;
    auto created = Renderer::create(loaded.scene, settings);
    if (!created.ok()) return created.status();
    const std::shared_ptr<const Renderer> renderer = std::move(created).value();
    return RenderGroup([renderer](const UnitWork& work) { return renderer->render(work, {}); });
}

}  // namespace lightloom::equivalence
