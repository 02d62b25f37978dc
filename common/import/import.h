#pragma once
// The importer's one entry point.

#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

struct ImportOptions {
    bool strict = false;                                    ///< Warnings become errors.
    uint64_t max_file_bytes = uint64_t(8) << 30;            ///< Larger files, and more text in all, are refused unread.
    uint64_t max_subdivided_triangles = uint64_t(1) << 23;  ///< Subdivision surfaces with more triangles are refused.
    /// The scene's root: the scene file lies below it, and the scene may not leave it. Empty: the root may lie up to three
    /// directories above the scene file's, or is the current directory if that is farther up; never that of the file system.
    std::string root;
    /// Names of features.h that are left out where the scene has them. An unknown one is an error.
    std::vector<std::string> without;
};

/// A feature that ImportOptions::without names and the scene has.
struct LeftOutFeature {
    std::string name;
    int count = 0;      ///< Number of directives, or of parameters of them.
    std::string first;  ///< Place of the first one, "file:line".
};

struct ImportedScene {
    SceneDescription description;
    /// Directory of the main file, or one above it that holds everything that was read: the smallest possible root of
    /// the scene.
    std::string directory;
    /// Every file that was read, as a path relative to `directory` (the main file first, in the order of first use). A scene
    /// that refers to files outside its root (absolute path, "..") is an error: it could not be sent to a worker.
    std::vector<std::string> files;
    std::vector<LeftOutFeature> left_out;  ///< Sorted by name.
};

/// Reads a pbrt-v4 scene file with all that it includes. Errors are one line: "file:line: what is wrong; what to do".
Result<ImportedScene> import_pbrt(const std::string& path, const ImportOptions& options = {});

/// Returns every fault that keeps import_pbrt() from reading the file, not only the first one, as such lines; faults of
/// the same kind are counted. Faulty parts are replaced by harmless ones meanwhile. Empty if the file can be read.
std::vector<std::string> import_faults(const std::string& path, const ImportOptions& options = {});

}  // namespace lightloom
