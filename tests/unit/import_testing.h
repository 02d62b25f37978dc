#pragma once
// Scenes in memory for the importer's tests.

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "common/import/importer.h"

namespace lightloom::testing {

using FileMap = std::map<std::string, std::string>;

/// Imports `world` behind a minimal header as "scene.pbrt", with further files beside it.
inline Result<ImportedScene> import_text(const std::string& text, FileMap files = {}, bool strict = false) {
    files["scene.pbrt"] = text;
    import::MemorySource source(files);
    ImportOptions options;
    options.strict = strict;
    options.max_file_bytes = 1 << 20;
    return import::import_from(&source, "scene.pbrt", options);
}

inline Result<ImportedScene> import_world(const std::string& world, FileMap files = {}, bool strict = false) {
    return import_text("PixelFilter \"box\"\nWorldBegin\n" + world, std::move(files), strict);
}

/// The description of a world that must load.
inline SceneDescription world(const std::string& text, FileMap files = {}) {
    Result<ImportedScene> scene = import_world(text, std::move(files));
    EXPECT_TRUE(scene.ok()) << scene.status().message() << "\n" << text;
    return scene.ok() ? std::move(scene->description) : SceneDescription{};
}

/// The one-line error of a world that must not load; every part of the message that matters is checked.
inline void expect_error(const std::string& text, std::initializer_list<const char*> parts, FileMap files = {}) {
    const Result<ImportedScene> scene = import_world(text, std::move(files));
    ASSERT_FALSE(scene.ok()) << "this must not load: " << text;
    const std::string& message = scene.status().message();
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    for (const char* part : parts) EXPECT_NE(message.find(part), std::string::npos) << "no \"" << part << "\" in: " << message;
}

/// A world that loads with exactly one warning, which contains `part`; under --strict it is an error.
inline void expect_warning(const std::string& text, const char* part, FileMap files = {}) {
    const Result<ImportedScene> scene = import_world(text, files);
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    ASSERT_EQ(scene->description.warnings.size(), 1u) << text;
    EXPECT_NE(scene->description.warnings[0].find(part), std::string::npos) << scene->description.warnings[0];
    EXPECT_FALSE(import_world(text, files, true).ok());
}

}  // namespace lightloom::testing
