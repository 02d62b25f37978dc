#pragma once
// Files that appear whole or not at all.

#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

/// Writes `bytes` under a temporary name in the same folder, flushes it to disk and renames it to `path`; an existing file
/// is replaced, through symbolic links. After an error nothing new is left behind. A pipe or a device is written to as it is.
Status write_file_atomically(const std::string& path, std::string_view bytes);

/// The whole file. kNotFound or kInvalidArgument names the path.
Result<std::string> read_file(const std::string& path);

}  // namespace lightloom
