#pragma once
// Where learned tables are kept between runs, for the commands that render in this process: the options, and the tables of a job
// from there or made anew.

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>

#include "client/job_options.h"
#include "client/progressive_render.h"
#include "common/cli/command_line.h"

namespace lightloom::client {

struct TableCacheOptions {
    TableCacheOptions();

    std::string directory;      ///< "off": none. At first that of the user.
    uint64_t megabytes = 1024;  ///< That it may hold.

    /// Empty for "off", as TableCache and the coordinator want it.
    std::filesystem::path path() const { return directory == "off" ? std::filesystem::path() : std::filesystem::path(directory); }
    uint64_t bytes() const { return megabytes << 20; }
};

/// --table-cache and --table-cache-size.
void add_table_cache_options(cli::App command, TableCacheOptions& options);

/// Adds the same options for a command that measures: the cache is off, whatever the environment says, until a directory is given.
void add_measured_table_cache_options(cli::App command, TableCacheOptions& options);

/// The tables that a job on `scene` renders with, those that a coordinator would learn for it: from the cache, which is where its
/// `render` put them, or else made here, on the threads of the calling arena, and put there, which a line on standard error says.
/// Empty for an algorithm without tables. `spec` has the frame and the depth.
Result<Preparation> cached_preparation(const Scene& scene, const JobSpec& spec, const TableCacheOptions& options, bool quiet,
                                       std::stop_token stop);
/// Gives the tables alone.
Result<Tables> cached_tables(const Scene& scene, const JobSpec& spec, const TableCacheOptions& options, bool quiet,
                             std::stop_token stop);

}  // namespace lightloom::client
