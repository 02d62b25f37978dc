#include "client/job_options.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <set>

#include "client/commands.h"
#include "client/default_algorithm.h"
#include "common/cli/command_line.h"
#include "common/cli/numbers.h"
#include "common/core/utf8.h"
#include "common/import/features.h"
#include "common/path/path_view.h"
#include "common/scene/scene.h"

namespace lightloom::client {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

}  // namespace

void add_scene_options(cli::App command, SceneOptions& options) {
    command
        .add_option("--root", options.root,
                    "Directory that holds the scene file and everything that it refers to (default: one up to three levels "
                    "above the scene file's, or the current one if the scene file lies farther below it)")
        ->type_name("DIR");
    command
        .add_option("--without", options.without,
                    "Leave out what is not supported: names of " + scene_feature_names() + ", with commas between them")
        ->type_name("NAME")
        ->delimiter(',')
        ->take_all()
        ->allow_extra_args(false)
        ->check([](const std::string& name) { return check_scene_features({name}).message(); });
}

void report_left_out(const SceneOptions& options, const ImportedScene& scene) {
    if (options.without.empty()) return;
    std::string text;
    for (const std::string& name : std::set<std::string>(options.without.begin(), options.without.end())) {
        const auto found =
            std::find_if(scene.left_out.begin(), scene.left_out.end(), [&](const LeftOutFeature& f) { return f.name == name; });
        text += (text.empty() ? "" : ", ") + name;
        text += found == scene.left_out.end() ? " (the scene has none)"
                                              : " (" + std::to_string(found->count) + ", first at " + found->first + ")";
    }
    std::fprintf(stderr, "lightloom: left out: %s\n", text.c_str());
}

void add_render_settings(cli::App command, JobOptions& options) {
    command
        .add_option("SCENE", options.scene,
                    "pbrt-v4 scene file; everything that it refers to lies beside or below it, or see --root")
        ->type_name("FILE")
        ->required();
    add_scene_options(command, options.reading);
    command
        .add_option("-a,--algorithm", options.algorithm,
                    "Name from `lightloom algorithms` (default: what the scene's Integrator asks for)")
        ->type_name("NAME")
        ->check([](const std::string& name) { return name.empty() ? "an empty name" : std::string(); });
    command
        .add_option(
            "--set", options.settings,
            "Parameter of the algorithm, for example heuristic=power; may be repeated; `lightloom algorithms NAME` lists them")
        ->type_name("KEY=VALUE")
        ->take_all()
        ->allow_extra_args(false);
    command.add_option("--max-depth", options.max_depth, "Bounces; paths have up to this + 1 edges (default: the scene's)")
        ->type_name("N")
        ->check(whole_number_between(0, kMaxEdges - 1));
    command.add_option("--resolution", options.resolution, "Pixels of the whole frame, for example 640x360 (default: the scene's)")
        ->type_name("WxH");
    command
        .add_option("--crop", options.crop,
                    "Window of the frame that is rendered, in pixels from the top left, X1 and Y1 not included "
                    "(default: the scene's)")
        ->type_name("X0,X1,Y0,Y1");
    command.add_option("--seed", options.seed, "Another seed makes another, independent image")
        ->type_name("N")
        ->capture_default_str()
        ->check(whole_number());
}

void add_image_settings(cli::App command, JobOptions& options) {
    command.add_flag("--half", options.half,
                     "Write colour as half floats; refused where a value is beyond their range, and nothing is lost");
    const auto png = command.add_option("--png", options.png, "Also write an 8-bit sRGB picture")->type_name("FILE");
    command.add_option("--exposure", options.exposure, "Stops by which the picture is brightened (the EXR never is)")
        ->type_name("STOPS")
        ->capture_default_str()
        ->check(number_between(-30.0, 30.0))
        ->needs(png);
}

void add_output_settings(cli::App command, JobOptions& options) {
    command
        .add_option("-o,--output", options.output,
                    "EXR to write; its manifest goes beside it (default: the scene's name with .exr, in the "
                    "current directory)")
        ->type_name("FILE");
    add_image_settings(command, options);
    command.add_flag("--layers", options.layers, "Also store albedo, normal and depth of what the camera sees first");
    const auto spp = command
                         .add_option("--spp", options.samples_per_pixel,
                                     "Samples per pixel (default: the scene's, unless --time or --noise is given)")
                         ->type_name("N")
                         ->check(whole_number_between(1, JobSpec::kMaxSamplesPerPixel));
    command
        .add_option("--time", options.time_seconds,
                    "Stop after so many seconds of learning and rendering, at a number of samples that --spp can reproduce; "
                    "reading the scene and waiting for a service's workers come on top")
        ->type_name("SECONDS")
        ->check(number_between(kMinTimeLimit, kMaxTimeLimit))
        ->excludes(spp);
    command
        .add_option("--noise", options.noise_target,
                    "Stop when the image's relMSE, as its own groups of iterations show it, is not above this; with --spp or "
                    "--time, whichever comes first")
        ->type_name("RELMSE")
        ->check(number_between(JobSpec::kMinNoiseTarget, JobSpec::kMaxNoiseTarget));
    command.add_option("--json", options.json, "Also write statistics: seconds of every phase, samples, rays")->type_name("FILE");
    command.add_flag("-q,--quiet", options.quiet, "Print errors only");
    command.add_flag("--strict", options.strict,
                     "Warnings about the scene are errors, and dropped (non-finite) samples make the exit code 3");
}

Result<LocalScene> load_scene(const JobOptions& options) {
    LocalScene scene;
    auto begin = Clock::now();
    auto imported =
        import_pbrt(options.scene, {.strict = options.strict, .root = options.reading.root, .without = options.reading.without});
    if (!imported.ok()) return imported.status();
    scene.imported = *std::move(imported);
    scene.import_seconds = seconds_since(begin);
    if (!options.quiet) {
        report_left_out(options.reading, scene.imported);
        for (const std::string& warning : scene.imported.description.warnings)
            std::fprintf(stderr, "lightloom: warning: %s\n", warning.c_str());
        if (options.algorithm.empty())
            std::fprintf(stderr, "lightloom: %s\n", default_algorithm(scene.imported.description.integrator).reason.c_str());
    }
    begin = Clock::now();
    scene.directory = scene.imported.directory;
    // Of what is to be left out, that which is there: a scene that has none of it is the same with the option as without.
    std::vector<std::string> without;
    for (const LeftOutFeature& feature : scene.imported.left_out) without.push_back(feature.name);
    auto manifest = AssetManifest::of_files(scene.directory, scene.imported.files, without);
    if (!manifest.ok()) return manifest.status();
    scene.manifest = *std::move(manifest);
    scene.digest_seconds = seconds_since(begin);
    return scene;
}

std::vector<std::filesystem::path> files_of(const LocalScene& scene) {
    std::vector<std::filesystem::path> files;
    for (const std::string& file : scene.imported.files) files.push_back(scene.directory / file);
    return files;
}

Status check_bound(const JobOptions& options, const JobSpec& spec) {
    if (spec.samples_per_pixel <= JobSpec::kMaxSamplesPerPixel) return {};
    return invalid_argument(options.scene + ": its sampler asks for more samples per pixel than the " +
                            std::to_string(JobSpec::kMaxSamplesPerPixel) + " of a job; give --spp");
}

Result<JobSpec> make_spec(const JobOptions& options, const LocalScene& scene) {
    JobSpec spec;
    std::map<std::string, std::string> parameters;
    for (const std::string& setting : options.settings) {
        const size_t equals = setting.find('=');
        if (equals == std::string::npos || equals == 0) return invalid_argument("--set takes KEY=VALUE, not \"" + setting + "\"");
        const std::string key = setting.substr(0, equals);
        if (!parameters.emplace(key, setting.substr(equals + 1)).second)
            return invalid_argument("--set " + key + " is given twice; which value is meant?");
    }
    auto algorithm = AlgorithmSettings::parse(
        options.algorithm.empty() ? default_algorithm(scene.imported.description.integrator).name : options.algorithm, parameters);
    if (!algorithm.ok()) return algorithm.status();
    spec.algorithm = *std::move(algorithm);
    spec.seed = options.seed;
    spec.time_limit_seconds = options.time_seconds;
    LL_RETURN_IF_ERROR(check_time_limit(spec.time_limit_seconds));
    spec.samples_per_pixel = options.samples_per_pixel;
    spec.noise_target = options.noise_target;
    if (spec.noise_target > 0 && spec.samples_per_pixel > 0 && spec.samples_per_pixel < NoiseEstimate::kLeastGroups)
        return invalid_argument("--noise needs --spp " + std::to_string(NoiseEstimate::kLeastGroups) +
                                " at least: noise is estimated from as many groups of iterations");
    if (spec.samples_per_pixel == 0 && spec.time_limit_seconds == 0 && spec.noise_target == 0)
        spec.samples_per_pixel = uint32_t(
            std::clamp<int64_t>(scene.imported.description.samples_per_pixel, 1, int64_t(JobSpec::kMaxSamplesPerPixel) + 1));
    spec.max_depth = options.max_depth;
    spec.first_hit_layers = options.layers;
    if (!options.resolution.empty()) {
        int used = 0;
        const bool parsed = std::sscanf(options.resolution.c_str(), "%6dx%6d%n", &spec.width, &spec.height, &used) == 2;
        if (!parsed || size_t(used) != options.resolution.size() || spec.width < 1 || spec.height < 1)
            return invalid_argument("--resolution takes WIDTHxHEIGHT, for example 640x360, not \"" + options.resolution + "\"");
    }
    const FilmDescription& film = scene.imported.description.film;
    if (!options.crop.empty()) {
        int used = 0;
        Rect& c = spec.crop;
        const bool parsed = std::sscanf(options.crop.c_str(), "%6d,%6d,%6d,%6d%n", &c.x0, &c.x1, &c.y0, &c.y1, &used) == 4;
        if (!parsed || size_t(used) != options.crop.size())
            return invalid_argument("--crop takes X0,X1,Y0,Y1 in pixels, for example 100,200,50,120, not \"" + options.crop + "\"");
        LL_RETURN_IF_ERROR(check_crop(c, spec.width > 0 ? spec.width : film.width, spec.height > 0 ? spec.height : film.height));
    }
    const auto frame = frame_layout(film, scene_options(spec));
    if (!frame.ok()) return frame.status();
    spec.scene_root = scene.manifest.root();
    return spec;
}

std::filesystem::path output_path(const JobOptions& options) {
    if (!options.output.empty()) return options.output;
    return std::filesystem::path(options.scene).filename().replace_extension(".exr");
}

int exit_code_of(const Status& status) {
    switch (status.code()) {
        case StatusCode::kOk: return kSuccess;
        case StatusCode::kCancelled: return kCancelled;
        case StatusCode::kInvalidArgument:
        case StatusCode::kNotFound:
        case StatusCode::kUnimplemented: return kUsage;
        case StatusCode::kUnavailable:
        case StatusCode::kDeadlineExceeded: return kUnavailable;
        case StatusCode::kUnknown:
        case StatusCode::kAlreadyExists:
        case StatusCode::kPermissionDenied:
        case StatusCode::kResourceExhausted:
        case StatusCode::kFailedPrecondition:
        case StatusCode::kAborted:
        case StatusCode::kOutOfRange:
        case StatusCode::kInternal:
        case StatusCode::kDataLoss: return kFailure;
    }
    return kFailure;  // A code that only gRPC knows.
}

int report_error(const Status& status) {
    // What a service or a worker said may be part of it.
    std::fprintf(stderr, "lightloom: %s\n", one_line(status.message()).c_str());
    return exit_code_of(status);
}

}  // namespace lightloom::client
