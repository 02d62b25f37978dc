#pragma once
// The results of a finished job: the EXR, which holds only what every rendering of the same job reproduces, and beside
// it the manifest, which also tells when, where and by whom it was rendered.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/film/exr_io.h"
#include "common/work/service.h"
#include "server/reducer.h"
#include "server/unit_table.h"

namespace lightloom {

/// Names of files in a job's directory.
struct ImageFileNames {
    const char* image;
    const char* manifest;
};
inline constexpr ImageFileNames kImageFiles{"image.exr", "manifest.json"};
/// Of a job that ended without its image: its complete groups.
inline constexpr ImageFileNames kPartialFiles{"partial.exr", "partial.manifest.json"};

struct ManifestWorker {
    uint32_t index = 0;  ///< Refers to Manifest::units.
    std::string worker_id, host;
    uint64_t process_id = 0;
    uint32_t thread_count = 0;
};

struct Manifest {
    JobInfo job;
    BuildIdentity identity;
    std::string scene_main;               ///< Path of the scene file in its list.
    std::vector<std::string> without;     ///< Features that are left out of the scene.
    std::string created_at, finished_at;  ///< UTC.
    uint32_t groups = 0;
    uint64_t iterations = 0;
    std::vector<UnitTable::Merged> units;
    std::vector<ManifestWorker> workers;
    std::vector<Reducer::Dropped> dropped;  ///< The first few of them.
    uint64_t expired_leases = 0, rejected_results = 0;
};

/// The present date and time, UTC, as manifests show it.
std::string utc_now();
/// Command line for a shell that renders one dropped sample again. For a splat it renders the unit, because only the
/// pixel in which the splat would have landed is known.
std::string replay_command(const JobSpec& spec, const std::string& scene, const Reducer::Dropped& dropped,
                           const std::vector<std::string>& without = {});
/// The settings of light transport, as manifests and reports of references show them.
nlohmann::ordered_json settings_json(const JobSpec& spec);
/// Light that may not have been found, as manifests, statistics and the status endpoint show it.
nlohmann::ordered_json to_json(const RareLightReport& report);
/// The estimated error of an image in the same places; null where it is not known. `target` is that of the job, or 0.
nlohmann::ordered_json to_json(const std::optional<NoiseReport>& noise, double target);
/// Tables as manifests and statistics show them.
nlohmann::ordered_json to_json(const TablesInfo& tables);
/// The manifest as JSON text.
std::string to_json(const Manifest& manifest);

/// The EXR's bytes: colour, its variance where that is known, and `layers`. They do not depend on who rendered it, and
/// how.
Result<std::string> encode_image(const JobSpec& spec, DevelopedImage developed, std::vector<ImageLayer> layers);
/// The same for the merged groups of `reducer`.
Result<std::string> encode_image(const JobSpec& spec, const Reducer& reducer, std::vector<ImageLayer> layers);
/// The groups merged so far, or the image in the file `written` when there is no reducer any more, as PNG brightened by `exposure`
/// stops or as EXR without first-hit layers. Needs memory for a few copies of the frame.
Result<Preview> make_preview(const JobSpec& spec, const std::filesystem::path& written, const Reducer* reducer,
                             PreviewFormat format, double exposure);

}  // namespace lightloom
