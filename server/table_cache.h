#pragma once
// Tables of earlier jobs on disk, by everything that they depend on, so that a job that was trained once starts at once the next
// time. One file per entry, checked whole when it is read; the directory may be shared by several processes.

#include <filesystem>
#include <optional>
#include <string>

#include "common/work/service.h"

namespace lightloom {

/// SHA-256 over the build, the algorithm with all of its parameters, seed, depth, scene and frame of a canonical, completed spec.
Digest table_key(const BuildIdentity& identity, const JobSpec& spec);

/// An entry's file holds the tables behind a header; both forms are understood. kDataLoss when the header does not fit the rest.
Result<std::string> tables_of_file(std::string bytes);

class TableCache {
  public:
    struct Entry {
        std::string bytes;  ///< As common/tables serializes them.
        TablesInfo info;    ///< Of the job that made them; `from_cache` is set.
    };

    /// An empty path is a cache that holds nothing. Above `max_bytes` the entries that were used least recently are removed.
    TableCache(std::filesystem::path directory, uint64_t max_bytes);

    /// Nothing when there is no entry, or a damaged one, which is removed with one line in the log.
    std::optional<Entry> find(const Digest& key, std::span<const TablePart* const> known) const;
    /// A failure costs the next job its time only: it is logged, not returned.
    void store(const Digest& key, std::string_view bytes, const TablesInfo& info) const;
    std::filesystem::path path_of(const Digest& key) const;

  private:
    void trim(const Digest& newest) const;

    std::filesystem::path directory_;
    uint64_t max_bytes_;
};

}  // namespace lightloom
