// lightloom inspect: what a scene file holds, and what of it was ignored.

#include <array>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/commands.h"
#include "client/default_algorithm.h"
#include "client/inspect_tables.h"
#include "client/job_options.h"
#include "client/output_files.h"
#include "common/cli/command_line.h"
#include "common/core/atomic_file.h"
#include "common/import/diagnostics.h"
#include "common/import/import.h"
#include "common/scene/scene.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom inspect room.pbrt
  lightloom inspect room.pbrt --why           everything that stops the file, if something does
  lightloom inspect room.pbrt -q -o room.json

Exit code 0 if the scene can be rendered, 2 if it cannot, or if --strict is given and something is ignored.)";

struct Options {
    std::string scene, json, tables, draw;
    SceneOptions reading;
    bool strict = false, quiet = false, why = false;
};

const char* name_of(MaterialKind kind) {
    constexpr std::array<const char*, 8> kNames{"diffuse",        "diffusetransmission", "conductor",       "dielectric",
                                                "thindielectric", "coateddiffuse",       "coatedconductor", "mix"};
    return kNames[size_t(kind)];
}

const char* name_of(TextureKind kind) {
    constexpr std::array<const char*, 11> kNames{"constant", "scale", "mix",      "checkerboard", "image", "solid checkerboard",
                                                 "dots",     "fbm",   "wrinkled", "windy",        "marble"};
    return kNames[size_t(kind)];
}

const char* name_of(CameraKind kind) {
    constexpr std::array<const char*, 4> kNames{"perspective", "orthographic", "equal-area", "equirectangular"};
    return kNames[size_t(kind)];
}

std::string megabytes(uint64_t bytes) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f MB", double(bytes) * 1e-6);
    return text;
}

/// How often each kind occurs, constants (which are mere numbers) left out.
template <typename Items>
std::map<std::string, size_t> count_kinds(const Items& items) {
    std::map<std::string, size_t> counts;
    for (const auto& item : items) ++counts[name_of(item.kind)];
    counts.erase("constant");
    return counts;
}

nlohmann::json describe(const SceneDescription& d, const SceneSummary& s, const std::vector<std::string>& files,
                        const std::vector<LeftOutFeature>& left_out, double import_seconds) {
    nlohmann::json out;
    out["triangles"] = s.triangle_count;
    out["triangles_instanced"] = s.instanced_triangle_count;
    out["triangles_emissive"] = s.emissive_triangle_count;
    out["spheres"] = s.sphere_count;
    out["instances"] = s.instance_count;
    out["camera"] = {
        {"kind", name_of(d.camera.kind)}, {"fov_degrees", d.camera.fov_degrees}, {"lens_radius", d.camera.lens_radius}};
    out["film"] = {{"width", d.film.width},
                   {"height", d.film.height},
                   {"exposure_scale", d.film.response.exposure * d.strength_scale},
                   {"colour_matrix", d.film.response.colour}};
    out["origin"] = d.origin;
    out["max_depth"] = d.max_depth;
    out["samples_per_pixel"] = d.samples_per_pixel;
    out["lights"] = nlohmann::json::array();
    for (const SceneSummary::Light& l : s.lights)
        out["lights"].push_back({{"kind", l.kind}, {"where", l.where}, {"power", l.power}, {"primitives", l.primitives}});
    out["materials"] = nlohmann::json::array();
    for (const Material& m : d.materials) out["materials"].push_back({{"name", m.name}, {"kind", name_of(m.kind)}});
    out["textures"] = count_kinds(d.textures);
    out["images"] = nlohmann::json::array();
    for (const Image& i : d.images)
        out["images"].push_back(
            {{"file", i.name}, {"width", i.width}, {"height", i.height}, {"channels", i.channels}, {"bytes", i.memory_bytes()}});
    out["memory_bytes"] = {{"geometry", s.geometry_bytes}, {"acceleration", s.acceleration_bytes}, {"images", s.image_bytes}};
    out["seconds"] = {{"import", import_seconds}, {"build", s.build_seconds}};
    out["files"] = files;
    out["integrator"] = d.integrator;
    out["algorithm"] = default_algorithm(d.integrator).name;
    out["replaced"] = {{"film_filename", d.film.file_name}};
    out["ignored"] = d.warnings;
    out["left_out"] = nlohmann::json::array();
    for (const LeftOutFeature& f : left_out) out["left_out"].push_back({{"name", f.name}, {"count", f.count}, {"first", f.first}});
    return out;
}

void print(const SceneDescription& d, const SceneSummary& s, const std::string& path, size_t file_count, double import_seconds) {
    std::printf("%s (%zu file%s)\n", path.c_str(), file_count, file_count == 1 ? "" : "s");
    std::printf("  geometry   %" PRIu64 " triangles (%" PRIu64 " emissive), %" PRIu64 " spheres", s.triangle_count,
                s.emissive_triangle_count, s.sphere_count);
    if (s.instance_count > 0)
        std::printf(", %" PRIu64 " instances showing %" PRIu64 " triangles", s.instance_count, s.instanced_triangle_count);
    std::printf("\n  camera     %s", name_of(d.camera.kind));
    if (d.camera.kind == CameraKind::kPerspective) std::printf(", fov %g degrees", double(d.camera.fov_degrees));
    std::printf("%s; film %d x %d, maxdepth %d, %d samples per pixel\n", d.camera.lens_radius > 0 ? ", thin lens" : "",
                d.film.width, d.film.height, d.max_depth, d.samples_per_pixel);
    std::printf("  lights     %zu\n", s.lights.size());
    for (const SceneSummary::Light& l : s.lights) {
        std::printf("    %-11s power %.6g W", l.kind.c_str(), l.power);
        if (l.primitives > 1) std::printf(", %" PRIu64 " primitives", l.primitives);
        std::printf("%s%s\n", l.where.empty() ? "" : ", ", l.where.c_str());
    }
    std::printf("  materials  %zu:", d.materials.size());
    for (const auto& [name, count] : count_kinds(d.materials)) std::printf(" %zu %s", count, name.c_str());
    std::printf("\n  textures   %zu images (%s)", d.images.size(), megabytes(s.image_bytes).c_str());
    for (const auto& [name, count] : count_kinds(d.textures)) std::printf(", %zu %s", count, name.c_str());
    std::printf("\n  memory     geometry %s, acceleration structure %s, images %s\n", megabytes(s.geometry_bytes).c_str(),
                megabytes(s.acceleration_bytes).c_str(), megabytes(s.image_bytes).c_str());
    std::printf("  time       %.3f s to read, %.3f s to build\n", import_seconds, s.build_seconds);
    std::printf("  algorithm  %s\n", default_algorithm(d.integrator).reason.c_str());
    if (!d.film.file_name.empty())
        std::printf("  replaced   Film's \"string filename\" %s, by -o\n", import::quoted(d.film.file_name).c_str());
    std::printf("  ignored    %s\n", d.warnings.empty() ? "nothing" : "");
    for (const std::string& warning : d.warnings) std::printf("    %s\n", warning.c_str());
}

/// A scene's names may be anything, JSON's strings only UTF-8.
Status write_json(const std::string& path, const nlohmann::json& json) {
    return write_file_atomically(path, json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

/// Everything that stops the file; kSuccess if nothing does.
int show_why(const Options& options, const ImportOptions& import_options) {
    const std::vector<std::string> faults = import_faults(options.scene, import_options);
    if (faults.empty()) {
        if (!options.quiet) std::printf("nothing stops %s\n", options.scene.c_str());
        return kSuccess;
    }
    for (const std::string& fault : faults) std::printf("%s\n", fault.c_str());
    if (!options.json.empty()) {
        const std::vector<std::filesystem::path> inputs{options.scene};
        if (const Status s = check_output_files(inputs, std::vector{options.json}); !s.ok()) return report_error(s);
        if (const Status s = write_json(options.json, {{"stops", faults}}); !s.ok()) return report_error(s);
    }
    std::fprintf(stderr, "lightloom: %zu thing%s stop%s %s\n", faults.size(), faults.size() == 1 ? "" : "s",
                 faults.size() == 1 ? "s" : "", options.scene.c_str());
    return kUsage;
}

int run(const Options& options) {
    const ImportOptions import_options{.strict = options.strict, .root = options.reading.root, .without = options.reading.without};
    if (options.why)
        if (const int code = show_why(options, import_options); code != kSuccess) return code;
    const auto begin = std::chrono::steady_clock::now();
    Result<ImportedScene> imported = import_pbrt(options.scene, import_options);
    if (!imported.ok()) {
        (void)report_error(imported.status());
        return kUsage;
    }
    std::vector<std::filesystem::path> inputs{options.tables};
    for (const std::string& file : imported->files) inputs.push_back(std::filesystem::path(imported->directory) / file);
    if (!options.quiet) report_left_out(options.reading, *imported);
    std::vector<std::string> outputs{options.json};
    if (!options.draw.empty())
        for (const char* picture : kTablePictures) outputs.push_back(options.draw + picture);
    if (const Status s = check_output_files(inputs, outputs); !s.ok()) return report_error(s);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const Result<std::unique_ptr<Scene>> scene = Scene::build(std::move(imported->description));
    if (!scene.ok()) {
        (void)report_error(scene.status());
        return kUsage;
    }
    const SceneDescription& description = (*scene)->description();
    const SceneSummary& summary = (*scene)->summary();
    if (!options.quiet) print(description, summary, options.scene, imported->files.size(), seconds);
    std::optional<TableFile> tables;
    if (!options.tables.empty()) {
        auto read = read_tables(options.tables, **scene);
        if (!read.ok()) return report_error(read.status());
        tables = *std::move(read);
        if (!options.quiet) print(*tables, **scene);
        if (!options.draw.empty())
            if (const Status s = draw(*tables, **scene, options.draw); !s.ok()) return report_error(s);
    }
    if (!options.json.empty()) {
        nlohmann::json out = describe(description, summary, imported->files, imported->left_out, seconds);
        if (tables) out["tables"] = describe(*tables, **scene);
        if (const Status s = write_json(options.json, out); !s.ok()) return report_error(s);
    }
    return kSuccess;
}

}  // namespace

void add_inspect_command(cli::App app, int* exit_code) {
    const auto options = std::make_shared<Options>();
    const cli::App command = app.add_subcommand("inspect",
                                                "Show what a scene holds: geometry, lights with their power, materials, textures, "
                                                "memory, and everything in the file that is ignored");
    command->add_option("SCENE", options->scene, "pbrt-v4 scene file")->type_name("FILE")->required();
    command->add_flag("--why", options->why,
                      "List everything that stops the file, not only the first fault, and exit with 2 if anything does");
    add_scene_options(*command, options->reading);
    command->add_option("-o,--output,--json", options->json, "Write the same as JSON to FILE")->type_name("FILE");
    const auto tables = command
                            ->add_option("--tables", options->tables,
                                         "Also show the learned tables in this file: KEY.tables of a table cache, KEY being "
                                         "tables.cache_key of a manifest")
                            ->type_name("FILE");
    command
        ->add_option("--draw", options->draw,
                     "Write PREFIX-kappa-eye.png, -kappa-light.png, -gamma.png and -q.png: subspaces of what the camera sees, "
                     "connection matrix, energies")
        ->type_name("PREFIX")
        ->needs(tables);
    command->add_flag("--strict", options->strict, "Take everything that is ignored for an error");
    command->add_flag("-q,--quiet", options->quiet, "Print nothing on success");
    command->footer(kFooter);
    command->callback([options, exit_code] { *exit_code = run(*options); });
}

}  // namespace lightloom::client
