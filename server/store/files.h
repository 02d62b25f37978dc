#pragma once
// What the store does to its own files, in one place, so that tests can make it fail.

#include <sys/types.h>
#include <sys/uio.h>

#include <filesystem>
#include <string>

#include "common/core/result.h"

namespace lightloom {

class StoreFiles {
  public:
    virtual ~StoreFiles() = default;
    /// Like pwritev(2).
    virtual ssize_t write(int file, const iovec* parts, int count, off_t offset);
    /// Like fdatasync(2).
    virtual int sync(int file);
    /// Flushes the names in a directory to disk, so that a new file is still there after a power failure.
    virtual Status sync_directory(const std::filesystem::path& directory);
    /// Those of the system.
    static StoreFiles& system();
};

/// Whether the error of a write says that there is no room: then it is worth trying again later.
bool is_no_room(int error);
/// "PATH: WHAT: text of the error"; kResourceExhausted where there is no room, or no more file descriptors, else kInternal.
Status file_error(const std::filesystem::path& path, const std::string& what, int error);
/// Creates the directory, unless it is there, and flushes its name to disk.
Status make_directory(const std::filesystem::path& directory, StoreFiles& files);

}  // namespace lightloom
