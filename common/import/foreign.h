#pragma once
// Recognises files that are not pbrt-v4 scenes although they were given as such.

#include <optional>
#include <string>
#include <string_view>

#include "common/import/parameters.h"

namespace lightloom::import {

/// For contents in another program's format: which format it is, and what to do. Nothing for contents that may be
/// pbrt's. `name` is the file's; its extension decides between formats that begin alike.
std::optional<std::string> foreign_scene(std::string_view name, std::string_view bytes);

/// Whether `bytes` are the pointer that Git LFS leaves in place of a file that is kept elsewhere.
bool is_lfs_pointer(std::string_view bytes);

/// Whether a directive exists only in pbrt before version 4: by its word ("SurfaceIntegrator"), or by its word and kind
/// ("Material", "matte"). `kind` may be empty.
bool is_old_directive(std::string_view word, std::string_view kind);

/// Whether the directive has a parameter that exists only before version 4: LightSource with "mapname", Material with
/// "Kd".
bool has_old_parameter(std::string_view word, const ParameterList& parameters);

/// What to do about such a file.
inline constexpr const char* kUpgrade =
    "this is the syntax of pbrt before version 4; convert the file with pbrt-v4's own `pbrt --upgrade old.pbrt > new.pbrt`";

}  // namespace lightloom::import
