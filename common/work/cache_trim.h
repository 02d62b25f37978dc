#pragma once
// Directories of files that can be had again, kept from growing without end.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace lightloom {

/// What a file in such a directory is. Other people's files are neither counted nor touched.
enum class CacheFile { kEntry, kUnfinished, kForeign };

/// Removes entries of `directories`, but not of directories in these, until those that are left have `max_bytes` at most in all:
/// the one whose modification time, which a user sets whenever it reads one, is the oldest goes first, and `newest` never. What is
/// unfinished goes when it is older than an hour, because whoever wrote it is dead. Other processes may do the same meanwhile.
void trim_cache(const std::vector<std::filesystem::path>& directories, uint64_t max_bytes, const std::filesystem::path& newest,
                const std::function<CacheFile(const std::filesystem::path&)>& kind_of);

}  // namespace lightloom
