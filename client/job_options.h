#pragma once
// The options that render, submit and replay share, and what they make of a scene file.

#include <filesystem>
#include <string>
#include <vector>

#include "common/cli/command_line.h"
#include "common/import/import.h"
#include "common/work/service.h"

namespace lightloom::client {

/// How a scene file is read, for every command that reads one.
struct SceneOptions {
    std::string root;                  ///< ImportOptions::root.
    std::vector<std::string> without;  ///< ImportOptions::without.
};
/// --root and --without.
void add_scene_options(cli::App command, SceneOptions& options);
/// "lightloom: left out: ..." on standard error, if something was to be.
void report_left_out(const SceneOptions& options, const ImportedScene& scene);

struct JobOptions {
    std::string scene;
    SceneOptions reading;
    std::string output;              ///< Empty: the scene's name with .exr, in the current directory.
    std::string png;                 ///< Empty: none.
    double exposure = 0;             ///< Of the PNG, in stops.
    std::string algorithm;           ///< Empty: what the scene asks for, see default_algorithm().
    uint32_t samples_per_pixel = 0;  ///< 0: the scene's (unless there is another bound).
    double time_seconds = 0;
    double noise_target = 0;  ///< 0: none.
    int max_depth = -1;
    std::string resolution;  ///< "WxH" or empty.
    std::string crop;        ///< "X0,X1,Y0,Y1" or empty.
    uint64_t seed = 0;
    std::vector<std::string> settings;  ///< "key=value"
    std::string json;
    bool quiet = false, strict = false, layers = false, half = false;
};

/// Scene, algorithm, depth, resolution, crop window, seed and parameters.
void add_render_settings(cli::App command, JobOptions& options);
/// --half, --png and --exposure, for every command that writes an image.
void add_image_settings(cli::App command, JobOptions& options);
/// Output, bounds, statistics.
void add_output_settings(cli::App command, JobOptions& options);

/// A scene that was read on this host.
struct LocalScene {
    std::filesystem::path directory;
    ImportedScene imported;
    AssetManifest manifest;
    double import_seconds = 0, digest_seconds = 0;
};
/// Imports (so that mistakes show before anything is sent) and digests the files. Prints the scene's warnings to standard
/// error (with `strict` they are errors), and which algorithm it asks for where the options name none.
Result<LocalScene> load_scene(const JobOptions& options);

/// The files that the scene consists of.
std::vector<std::filesystem::path> files_of(const LocalScene& scene);

/// What the options ask for, with the scene's algorithm and samples per pixel where they leave these open.
Result<JobSpec> make_spec(const JobOptions& options, const LocalScene& scene);
/// kInvalidArgument where the scene, not the options, asks for more samples than a job may have.
Status check_bound(const JobOptions& options, const JobSpec& spec);
std::filesystem::path output_path(const JobOptions& options);

/// "lightloom: message" on standard error; the exit code that fits.
int report_error(const Status& status);
/// Tells mistakes in the command or scene (2) and an unreachable service (4) from failures (1).
int exit_code_of(const Status& status);

}  // namespace lightloom::client
