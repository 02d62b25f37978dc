// Estimates and intervals of `reference_equivalence`.

#include <chrono>
#include <cstdio>

#include "common/film/grouped_sum.h"
#include "common/import/import.h"
#include "common/transport/training.h"
#include "tests/statistical/reference_equivalence.h"

namespace lightloom::equivalence {

PartMeans part_means(const RgbImage& image) {
    PartMeans means = luminance_means(image, 3, 3);
    double sum[3] = {};
    for (size_t i = 0; i < image.pixels.size(); ++i) sum[i % 3] += image.pixels[i];
    for (const double channel : sum) means.push_back(channel * 3 / double(image.pixels.size()));
    return means;
}

Result<Rendering> render_groups(const Scene& scene, const RenderGroup& render, double seconds,
                                const std::function<bool(const Rendering&)>& settled) {
    constexpr uint32_t kIterations = 2, kLeastGroups = 16;
    const FrameLayout frame = scene.frame();
    const FilmResponse response = scene.description().film.response;
    GroupedSum total(frame, response);
    GroupSum sum(frame);
    Rendering result;
    const auto start = std::chrono::steady_clock::now();
    for (uint32_t group = 0;; ++group) {
        const RenderUnit work{
            uint64_t(group) * kIterations, kIterations, group, frame.crop, 0, uint64_t(kIterations) * uint64_t(frame.crop.area())};
        auto partial = render(work);
        if (!partial.ok()) return partial.status();
        LL_RETURN_IF_ERROR(total.add(*partial));
        LL_RETURN_IF_ERROR(total.fold(kIterations, &sum));
        Accumulation alone(frame, response);
        LL_RETURN_IF_ERROR(alone.fold(sum, kIterations));
        const PartMeans means = part_means(alone.develop());
        for (size_t part = 0; part < means.size(); ++part) result.parts[part].add(means[part], kIterations);
        result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (group + 1 >= kLeastGroups && (result.seconds >= seconds || settled(result))) break;
    }
    result.iterations = total.complete().iterations();
    result.dropped = total.complete().dropped();
    result.picture = total.complete().develop();
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
    const auto parsed = AlgorithmSettings::parse(algorithm, {});
    if (!parsed.ok()) return parsed.status();
    auto created = create_with_tables(loaded.scene, {*parsed, seed, loaded.max_depth}, {});
    if (!created.ok()) return created.status();
    const std::shared_ptr<const Renderer> renderer = std::move(created).value();
    const uint64_t light_paths = parsed->light_paths_per_iteration(loaded.scene->frame().crop.area());
    return RenderGroup([renderer, light_paths](RenderUnit work) {
        work.light_path_count = work.iteration_count * light_paths;
        return renderer->render(work, {});
    });
}

}  // namespace lightloom::equivalence
