#pragma once
// Keeps directories of files that can be made or fetched again from growing without end.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace lightloom {

/// What kind of file a directory holds. Foreign files are neither counted nor touched.
enum class CacheFile { kEntry, kUnfinished, kForeign };

/// Removes entries of `directories`, but not of their subdirectories, until the rest have at most `max_bytes` together.
/// The entry with the oldest modification time goes first (users set it whenever they read an entry), and `newest`
/// never goes. An unfinished file goes when it is older than an hour, because its writer is dead. Other processes may
/// do the same meanwhile.
void trim_cache(const std::vector<std::filesystem::path>& directories, uint64_t max_bytes, const std::filesystem::path& newest,
                const std::function<CacheFile(const std::filesystem::path&)>& kind_of);

}  // namespace lightloom
