#pragma once
// A disk on which SQLite finds no room.

#include <sqlite3.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace lightloom::testing {

/// While one lives, the writes of all databases of this process fail as long as `full` is set.
class FullDatabase {
  public:
    FullDatabase() : vfs_(sqlite3_vfs_find(nullptr)) {
        for (const char* name : {"pwrite64", "pwrite"})
            if (vfs_->xGetSystemCall(vfs_, name)) call_ = name;
        vfs_->xSetSystemCall(vfs_, call_, reinterpret_cast<sqlite3_syscall_ptr>(write));
    }
    ~FullDatabase() {
        vfs_->xSetSystemCall(vfs_, call_, nullptr);
        full = false;
    }
    FullDatabase(const FullDatabase&) = delete;

    static inline std::atomic<bool> full{false};

  private:
    static ssize_t write(int file, const void* bytes, size_t size, off_t offset) {
        if (!full) return ::pwrite(file, bytes, size, offset);
        errno = ENOSPC;
        return -1;
    }

    sqlite3_vfs* const vfs_;
    const char* call_ = nullptr;
};

}  // namespace lightloom::testing
