#pragma once
// Renders an image that others are measured by, with the error of its means and a description of how it was made.

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/bench/cross_check.h"

namespace lightloom::client {

struct MadeReference {
    ProgressiveRender render;
    std::vector<Estimate> regions;       ///< Mean luminances of the image and its regions, from its groups.
    std::string exr;                     ///< The file's bytes.
    nlohmann::ordered_json description;  ///< client/README.md has the fields.
    std::string note;                    ///< One line where tables are simpler than asked; else empty.
};

/// `spec` has a frame, a depth, a completed algorithm, and one of its two bounds; its time bounds the rendering alone.
/// `scene_file` and `threads` are for the description. Reports progress on standard error unless `quiet`.
Result<MadeReference> make_reference(const std::shared_ptr<const Scene>& scene, const JobSpec& spec, const std::string& scene_file,
                                     uint32_t threads, const PreparationSource& tables, bool quiet, std::stop_token stop);

/// The description's file: `exr_path` with .json.
std::string description_path(const std::string& exr_path);
/// Writes the EXR and its description, the description first: an EXR that is there is complete.
Status write_reference(const MadeReference& made, const std::string& exr_path);

}  // namespace lightloom::client
