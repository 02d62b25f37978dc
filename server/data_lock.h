#pragma once
// Only one coordinator may use a data directory: two would take each other's uploads and images for their own.

#include <filesystem>

#include "common/core/result.h"

namespace lightloom {

/// The lock is held until destruction; the system also releases it when the process is killed.
class DataLock {
  public:
    /// Locks `directory`, which must exist. kFailedPrecondition if another process holds it.
    static Result<DataLock> take(const std::filesystem::path& directory);
    DataLock(DataLock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
    DataLock& operator=(DataLock&&) = delete;
    ~DataLock();

  private:
    explicit DataLock(int descriptor) : descriptor_(descriptor) {}
    int descriptor_;
};

}  // namespace lightloom
