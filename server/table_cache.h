#pragma once
// Tables of earlier jobs on disk, by a key of everything that they depend on, so that the next job with the same key
// needs no training. Each entry is one file, which is checked completely when it is read; the directory may be shared
// by several processes.

#include <filesystem>
#include <optional>
#include <string>

#include "common/work/service.h"

namespace lightloom {

/// SHA-256 over the build, the algorithm with all of its parameters, seed, depth, scene and frame of a canonical, completed spec.
Digest table_key(const BuildIdentity& identity, const JobSpec& spec);

/// Returns the tables in a file, which is an entry of the cache (with a header) or holds the tables alone. kDataLoss
/// when the header does not fit the rest.
Result<std::string> tables_of_file(std::string bytes);

class TableCache {
  public:
    struct Entry {
        std::string bytes;  ///< The tables as common/tables serializes them.
        TablesInfo info;    ///< About the job that made them; `from_cache` is set.
    };

    /// With an empty path the cache holds nothing. Above `max_bytes` the least recently used entries are removed.
    TableCache(std::filesystem::path directory, uint64_t max_bytes);

    /// Returns nothing when there is no entry, or a damaged one, which is removed and logged.
    std::optional<Entry> find(const Digest& key, std::span<const TablePart* const> known) const;
    /// Stores an entry. A failure is only logged, because all it costs is the next job's time.
    void store(const Digest& key, std::string_view bytes, const TablesInfo& info) const;
    std::filesystem::path path_of(const Digest& key) const;

  private:
    void trim(const Digest& newest) const;

    std::filesystem::path directory_;
    uint64_t max_bytes_;
};

}  // namespace lightloom
