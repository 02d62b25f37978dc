#pragma once
// Reads whole files, and writes files that appear whole or not at all.

#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

/// Writes `bytes` under a temporary name in the same folder, flushes it to disk and renames it to `path`; an existing
/// file is replaced, and symbolic links are followed. After an error no new file is left behind. A pipe or a device is
/// written to directly.
Status write_file_atomically(const std::string& path, std::string_view bytes);

/// Reads the whole file. The error, kNotFound or kInvalidArgument, names the path.
Result<std::string> read_file(const std::string& path);

}  // namespace lightloom
