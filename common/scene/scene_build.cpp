// Scene::build(): prepares a description for rendering and counts what it holds.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

#include "common/scene/scene.h"

namespace lightloom {
namespace {

/// A triangle without area can neither be hit nor emit; dropping it keeps normals finite everywhere else.
void drop_degenerate_triangles(TriangleMesh* mesh) {
    std::vector<uint32_t>& index = mesh->indices;
    size_t kept = 0;
    for (size_t i = 0; i + 2 < index.size(); i += 3) {
        const Vec3 &a = mesh->positions[index[i]], &b = mesh->positions[index[i + 1]], &c = mesh->positions[index[i + 2]];
        const float area2 = length_squared(cross(b - a, c - a));
        if (!(area2 > 0) || !std::isfinite(1 / std::sqrt(area2))) continue;
        for (int k = 0; k < 3; ++k) index[kept + size_t(k)] = index[i + size_t(k)];
        kept += 3;
    }
    index.resize(kept);
}

/// Marks the materials that have a displacement or a normal map, or lead to one as mixes. Empty if none does.
std::vector<uint8_t> tilting_materials(const std::vector<Material>& materials) {
    std::vector<uint8_t> tilts(materials.size());
    const auto leads = [&](MaterialId id) { return id != kNone && tilts[size_t(id)] != 0; };
    for (bool found = true; found;) {
        found = false;
        for (size_t i = 0; i < materials.size(); ++i) {
            const Material& m = materials[i];
            const bool own = m.displacement != kNone || m.normal_map != kNone;
            if (tilts[i] != 0 || !(m.kind == MaterialKind::kMix ? leads(m.mix_a) || leads(m.mix_b) : own)) continue;
            tilts[i] = 1;
            found = true;
        }
    }
    if (std::find(tilts.begin(), tilts.end(), 1) == tilts.end()) tilts.clear();
    return tilts;
}

}  // namespace

void Scene::collect_emitters(std::vector<Emitter>* emitters, LightMaps* maps) {
    const auto new_light = [&](const std::string& source, const char* fallback = "") {
        light_sources_.push_back(source.empty() ? fallback : source);
        return int32_t(light_sources_.size()) - 1;
    };
    const auto new_emitter = [&](EmitterKind kind, const std::string& source, const char* fallback = "") {
        Emitter e;
        e.kind = kind;
        e.light = new_light(source, fallback);
        return e;
    };
    // Returns the emission of a shape, or null; before that it notes where the shape's emitters begin in `emitters`, if
    // a ray can meet the shape.
    const auto area_emission = [&](const ShapeAttributes& attributes, std::vector<int32_t>* first_emitter) {
        const AreaEmission* emission =
            attributes.emission != kNone ? &description_->emissions[size_t(attributes.emission)] : nullptr;
        if (emission && emission->radiance.is_black()) emission = nullptr;
        if (first_emitter) first_emitter->push_back(emission ? int32_t(emitters->size()) : kNone);
        return emission;
    };
    const auto new_area_emitter = [&](EmitterKind kind, const AreaEmission& emission, const std::string& source) {
        Emitter e = new_emitter(kind, source);
        e.two_sided = emission.two_sided;
        e.radiance = emission.radiance;
        return e;
    };
    // Returns the index of a primitive's map if its light has an image; `place` is the SurfaceMap constructor's
    // argument for the primitive.
    std::map<int32_t, Rgb> image_means;
    const auto add_map = [&](int32_t image, const auto& place) {
        if (image == kNone) return kNone;
        const Image& source = description_->images[size_t(image)];
        const auto [mean, inserted] = image_means.try_emplace(image);
        if (inserted) mean->second = source.mean();
        maps->surfaces.push_back({source, mean->second, place});
        return int32_t(maps->surfaces.size()) - 1;
    };
    const auto add_mesh = [&](const TriangleMesh& mesh, bool hidden) {
        const AreaEmission* emission = area_emission(mesh.attributes, hidden ? nullptr : &mesh_first_emitter_);
        if (!emission) return;
        Emitter e = new_area_emitter(EmitterKind::kTriangle, *emission, mesh.attributes.source);
        e.hidden = hidden;
        for (size_t t = 0; t + 2 < mesh.indices.size(); t += 3) {
            const uint32_t* index = &mesh.indices[t];
            e.position = mesh.positions[index[0]];
            e.edge1 = mesh.positions[index[1]] - e.position;
            e.edge2 = mesh.positions[index[2]] - e.position;
            e.reach = std::max({largest_coordinate(e.position), largest_coordinate(mesh.positions[index[1]]),
                                largest_coordinate(mesh.positions[index[2]])});
            const Vec3 n = cross(e.edge1, e.edge2);
            const float len = length(n);
            e.normal = n / len;
            e.inv_area = 2 / len;
            if (mesh.attributes.flip_normal) e.normal = -e.normal;
            // The emitting side must be the one that a hit sees: Scene::triangle_point() turns the geometric normal
            // towards the interpolated one, which may differ within a triangle only for broken meshes.
            if (!mesh.normals.empty())
                e.normal = face_forward(e.normal, mesh.normals[index[0]] + mesh.normals[index[1]] + mesh.normals[index[2]]);
            Vec2 uv[3] = {{0, 0}, {1, 0}, {1, 1}};
            for (size_t i = 0; i < 3 && !mesh.uvs.empty(); ++i) uv[i] = mesh.uvs[index[i]];
            e.map = add_map(emission->image, uv);
            emitters->push_back(e);
        }
    };
    const auto add_sphere = [&](const Sphere& s, bool hidden) {
        const AreaEmission* emission = area_emission(s.attributes, hidden ? nullptr : &sphere_emitter_);
        if (!emission) return;
        Emitter e = new_area_emitter(EmitterKind::kSphere, *emission, s.attributes.source);
        e.hidden = hidden;
        e.position = s.centre;
        e.radius = s.radius;
        e.reach = largest_coordinate(s.centre) + s.radius;
        e.inward = s.attributes.flip_normal;
        e.inv_area = 1 / (4 * kPi * s.radius * s.radius);
        e.map = add_map(emission->image, s.orientation);
        emitters->push_back(e);
    };
    for (const TriangleMesh& mesh : description_->meshes) add_mesh(mesh, false);
    for (const Sphere& s : description_->spheres) add_sphere(s, false);
    for (const TriangleMesh& mesh : description_->hidden_meshes) add_mesh(mesh, true);
    for (const Sphere& s : description_->hidden_spheres) add_sphere(s, true);
    for (const PointLight& l : description_->point_lights) {
        Emitter e = new_emitter(EmitterKind::kPoint, l.source, "point light");
        e.position = l.position;
        e.radiance = l.intensity;
        emitters->push_back(e);
    }
    for (const SpotLight& l : description_->spot_lights) {
        Emitter e = new_emitter(EmitterKind::kSpot, l.source, "spot light");
        e.position = l.position;
        e.normal = l.axes.n;
        e.radiance = l.intensity;
        e.total_height = l.total_height;
        e.falloff_height = l.falloff_height;
        emitters->push_back(e);
    }
    for (const ImageLight& l : description_->image_lights) {
        const bool projection = l.kind == ImageLight::Kind::kProjection;
        const Image& image = description_->images[size_t(l.image)];
        Emitter e = new_emitter(projection ? EmitterKind::kProjection : EmitterKind::kGoniometric, l.source,
                                projection ? "projection light" : "goniometric light");
        e.position = l.position;
        e.radiance = l.intensity;
        e.map = int32_t(maps->directions.size());
        maps->directions.push_back(projection ? DirectionMap::projection(image, l.light_to_world, l.half_width, l.half_height)
                                              : DirectionMap::goniometric(image, l.light_to_world));
        emitters->push_back(e);
    }
    for (const DistantLight& l : description_->distant_lights) {
        Emitter e = new_emitter(EmitterKind::kDistant, l.source, "distant light");
        e.normal = l.direction;
        e.radiance = l.irradiance;
        emitters->push_back(e);
    }
    if (!description_->infinite_lights.empty()) {
        std::string source = description_->infinite_lights[0].source;
        // All infinite lights are one emitter, which is sampled by their sum.
        const size_t others = description_->infinite_lights.size() - 1;
        if (others > 0 && !source.empty()) source += " (and " + std::to_string(others) + " more)";
        emitters->push_back(new_emitter(EmitterKind::kEnvironment, source, "infinite light"));
    }
}

float Scene::largest_reach(const Bounds3& bounds) const {
    float reach = largest_coordinate(description_->camera.camera_to_world.point({0, 0, 0}));
    if (!bounds.empty()) reach = std::max({reach, largest_coordinate(bounds.lo), largest_coordinate(bounds.hi)});
    for (const TriangleMesh& mesh : description_->hidden_meshes)
        for (const Vec3& p : mesh.positions) reach = std::max(reach, largest_coordinate(p));
    for (const Sphere& s : description_->hidden_spheres) reach = std::max(reach, largest_coordinate(s.centre) + s.radius);
    for (const PointLight& l : description_->point_lights) reach = std::max(reach, largest_coordinate(l.position));
    for (const SpotLight& l : description_->spot_lights) reach = std::max(reach, largest_coordinate(l.position));
    for (const ImageLight& l : description_->image_lights) reach = std::max(reach, largest_coordinate(l.position));
    return reach;
}

/// Finds what lies at distance zero from the camera, a lamp or an area light.
Status Scene::find_contacts(std::vector<Emitter>* emitters, float largest) {
    const ContactFinder contacts(*description_, *accel_, instance_inverse_, largest);
    camera_clearance_ = contacts.clearance(camera_.position());
    if (camera_.has_parallel_rays()) {
        const auto [corner, right, down] = camera_.window();
        camera_clearance_ = std::max(camera_clearance_, contacts.clearance(corner, right, down));
    }
    for (Emitter& e : *emitters)
        if (e.is_discrete() && !e.is_infinite()) e.clearance = contacts.clearance(e.position);
    const auto emits = [&](uint32_t mesh) { return mesh_first_emitter_[mesh] != kNone; };
    covered_ = contacts.cover(emitters, emits);
    if (!covered_.any) return {};
    std::vector<uint32_t> lights;
    for (uint32_t i = 0; i < description_->meshes.size(); ++i)
        if (emits(i)) lights.push_back(i);
    return accel_->keep_apart(*description_, lights, &Scene::opacity, this);
}

Status check_crop(const Rect& crop, int width, int height) {
    if (!crop.empty() && crop.x0 >= 0 && crop.y0 >= 0 && crop.x1 <= width && crop.y1 <= height) return {};
    const std::string window =
        std::to_string(crop.x0) + "," + std::to_string(crop.x1) + "," + std::to_string(crop.y0) + "," + std::to_string(crop.y1);
    const std::string w = std::to_string(width), h = std::to_string(height);
    return invalid_argument("the crop window " + window + " (X0,X1,Y0,Y1) does not fit: the frame has " + w + " x " + h +
                            " pixels, so 0 <= X0 < X1 <= " + w + " and 0 <= Y0 < Y1 <= " + h);
}

Result<FrameLayout> frame_layout(const FilmDescription& film, const SceneOptions& options) {
    if (options.width < 0 || options.height < 0 || (options.width == 0) != (options.height == 0))
        return invalid_argument("a resolution needs a positive width and height");
    FrameLayout frame;
    frame.width = options.width > 0 ? options.width : film.width;
    frame.height = options.height > 0 ? options.height : film.height;
    if (frame.width <= 0 || frame.height <= 0 || frame.width > kMaxFrameSide || frame.height > kMaxFrameSide)
        return invalid_argument("the image resolution must lie between 1 and " + std::to_string(kMaxFrameSide) + " pixels");
    frame.crop = {0, 0, frame.width, frame.height};
    if (options.crop != Rect{}) {
        LL_RETURN_IF_ERROR(check_crop(options.crop, frame.width, frame.height));
        frame.crop = options.crop;
    } else if (film.crop[0] >= 0) {
        // The crop scales with an overridden resolution, rounded outwards.
        const auto scaled = [](int v, int from, int to, bool up) { return int((int64_t(v) * to + (up ? from - 1 : 0)) / from); };
        frame.crop = {scaled(film.crop[0], film.width, frame.width, false), scaled(film.crop[2], film.height, frame.height, false),
                      scaled(film.crop[1], film.width, frame.width, true), scaled(film.crop[3], film.height, frame.height, true)};
        if (frame.crop.empty() || frame.crop.x1 > frame.width || frame.crop.y1 > frame.height)
            return invalid_argument("the film's crop window is empty or outside of the frame");
    }
    if (frame.crop.area() > kMaxPartialPixels)
        return invalid_argument("the resolution gives " + pixels_and_memory(frame.crop.area()) + "; at most " +
                                std::to_string(kMaxPartialPixels) + " are possible");
    return frame;
}

Result<std::unique_ptr<Scene>> Scene::build(SceneDescription description, const SceneOptions& options) {
    const auto start = std::chrono::steady_clock::now();
    std::unique_ptr<Scene> scene(new Scene);
    scene->description_ = std::make_shared<SceneDescription>(std::move(description));
    SceneDescription& d = *scene->description_;
    LL_RETURN_IF_ERROR(validate(d));

    const auto prepare = [](std::vector<TriangleMesh>& meshes) {
        for (TriangleMesh& m : meshes) {
            drop_degenerate_triangles(&m);
            m.positions.push_back({});  // padding that Embree's shared buffers need
        }
    };
    prepare(d.meshes);
    prepare(d.hidden_meshes);
    for (ObjectDefinition& o : d.objects) prepare(o.meshes);
    scene->tables_ = {d.textures, d.images, d.materials, d.texture_spaces};
    scene->tilts_ = tilting_materials(d.materials);
    for (const Instance& i : d.instances) scene->instance_inverse_.push_back(*inverse(i.object_to_world));

    Result<FrameLayout> layout = frame_layout(d.film, options);
    if (!layout.ok()) return layout.status();
    FrameLayout& frame = scene->frame_;
    frame = *layout;
    Result<Camera> camera = Camera::create(d.camera, frame.width, frame.height);
    if (!camera.ok()) return camera.status();
    scene->camera_ = *camera;

    Result<std::unique_ptr<Accel>> accel = Accel::build(d, &Scene::opacity, scene.get());
    if (!accel.ok()) return accel.status();
    scene->accel_ = std::move(accel).value();

    const Bounds3 bounds = scene->accel_->bounds();
    const float largest = scene->largest_reach(bounds);
    scene->least_reach_ = std::min(largest, kSmallScene);
    std::vector<Emitter> emitters;
    LightMaps maps;
    scene->collect_emitters(&emitters, &maps);
    for (Emitter& e : emitters) e.reach = std::max(e.reach, scene->least_reach_);
    LL_RETURN_IF_ERROR(scene->find_contacts(&emitters, largest));
    const Vec3 centre = bounds.empty() ? Vec3{} : bounds.centre();
    // A little larger than the bounding sphere, so that rounding never starts a light sub-path inside of the scene.
    const float radius = bounds.empty() ? 1.0f : length(bounds.hi - centre) * 1.0001f + 1e-6f;
    scene->emitters_ = EmitterSet(std::move(emitters), Environment(d.infinite_lights, d.images), centre, radius, std::move(maps));

    scene->summarise();
    scene->summary_.build_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return scene;
}

std::unique_ptr<const Scene> Scene::with_emission(std::shared_ptr<const EmissionTable> table) const {
    std::unique_ptr<Scene> scene(new Scene(*this));
    scene->emitters_.guide_emission(std::move(table));
    return scene;
}

void Scene::summarise() {
    SceneSummary& s = summary_;
    const auto count = [&](const std::vector<TriangleMesh>& meshes) {
        uint64_t triangles = 0;
        for (const TriangleMesh& m : meshes) {
            triangles += m.indices.size() / 3;
            s.geometry_bytes += m.positions.size() * sizeof(Vec3) + m.normals.size() * sizeof(Vec3) + m.uvs.size() * sizeof(Vec2) +
                                m.indices.size() * sizeof(uint32_t);
        }
        return triangles;
    };
    s.triangle_count = s.instanced_triangle_count = count(description_->meshes);
    s.sphere_count = description_->spheres.size();
    std::vector<uint64_t> object_triangles;
    for (const ObjectDefinition& o : description_->objects) {
        object_triangles.push_back(count(o.meshes));
        s.triangle_count += object_triangles.back();
        s.sphere_count += o.spheres.size();
    }
    for (const Instance& i : description_->instances) s.instanced_triangle_count += object_triangles[size_t(i.object)];
    s.instance_count = description_->instances.size();
    s.texture_count = description_->textures.size();
    for (const Image& image : description_->images) s.image_bytes += image.memory_bytes();
    s.acceleration_bytes = accel_->memory_bytes();
    static constexpr const char* kKinds[] = {"area", "area", "point", "spot", "distant", "infinite", "projection", "goniometric"};
    s.lights.resize(light_sources_.size());
    for (const Emitter& e : emitters_.all()) {
        SceneSummary::Light& light = s.lights[size_t(e.light)];
        light.kind = kKinds[int(e.kind)];
        light.where = light_sources_[size_t(e.light)];
        light.power += emitters_.power(e) / (double(scalar_of({1, 1, 1})) * description_->strength_scale);
        ++light.primitives;
        s.emissive_triangle_count += e.kind == EmitterKind::kTriangle;
    }
}

}  // namespace lightloom
