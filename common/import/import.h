#pragma once
// The importer's one entry point.

#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

struct ImportOptions {
    bool strict = false;                          ///< Warnings become errors.
    uint64_t max_file_bytes = uint64_t(8) << 30;  ///< Refuse larger files, and text beyond it in all, before reading them.
    uint64_t max_subdivided_triangles = uint64_t(1) << 23;  ///< Refuse subdivision surfaces that would become more.
    /// The scene's root: the scene file lies below it, and the scene may not leave it. Empty: the root may lie up to three
    /// directories above the scene file's, or is the current directory if that is farther up; never that of the file system.
    std::string root;
    /// Names of features.h that are left out where the scene has them. An unknown one is an error.
    std::vector<std::string> without;
};

/// A feature that ImportOptions::without names and the scene has.
struct LeftOutFeature {
    std::string name;
    int count = 0;      ///< Directives, or parameters of them.
    std::string first;  ///< Where the first one is, "file:line".
};

struct ImportedScene {
    SceneDescription description;
    /// That of the main file, or one above it that holds everything that was read: the scene's root, as small as can be.
    std::string directory;
    /// Every file that was read, as a path relative to `directory` (the main file first, in the order of first use). A scene
    /// that refers to files outside its root (absolute path, "..") is an error: it could not be sent to a worker.
    std::vector<std::string> files;
    std::vector<LeftOutFeature> left_out;  ///< By name.
};

/// Reads a pbrt-v4 scene file with all that it includes. Errors are one line: "file:line: what is wrong; what to do".
Result<ImportedScene> import_pbrt(const std::string& path, const ImportOptions& options = {});

/// Everything that keeps import_pbrt() from reading the file, not only the first fault: such lines, those of the same kind
/// counted. What could not be read is replaced by something harmless meanwhile; empty if nothing stops the file.
std::vector<std::string> import_faults(const std::string& path, const ImportOptions& options = {});

}  // namespace lightloom
