#pragma once
// Reads whole files, and writes files that appear whole or not at all.

#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

/// Writes `bytes` under a temporary name in the same folder, flushes both to disk and renames it to `path`; an existing
/// file is replaced, and symbolic links are followed. After an error no new file is left behind. A pipe or a device is
/// written to directly.
Status write_file_atomically(const std::string& path, std::string_view bytes);

/// Flushes the names in a folder to disk, so that what was made or renamed in it is still there after a power failure. A folder of
/// a kind that cannot be flushed counts as flushed.
Status flush_folder(const std::string& path);

/// Reads the whole file. The error, kNotFound or kInvalidArgument, names the path.
Result<std::string> read_file(const std::string& path);

}  // namespace lightloom
