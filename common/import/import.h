#pragma once
// The importer's one entry point.

#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

struct ImportOptions {
    bool strict = false;                                    ///< Warnings become errors.
    uint64_t max_file_bytes = uint64_t(8) << 30;            ///< Refuse larger files before reading them.
    uint64_t max_subdivided_triangles = uint64_t(1) << 23;  ///< Refuse subdivision surfaces that would become more.
};

struct ImportedScene {
    SceneDescription description;
    /// Every file that was read, as a path relative to the directory of the main file (the main file first, in the order
    /// of first use). A scene that refers to files outside its directory (absolute path, "..") is an error: it could not
    /// be sent to a worker.
    std::vector<std::string> files;
};

/// Reads a pbrt-v4 scene file with all that it includes. Errors are one line: "file:line: what is wrong; what to do".
Result<ImportedScene> import_pbrt(const std::string& path, const ImportOptions& options = {});

}  // namespace lightloom
