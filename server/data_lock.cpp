#include "server/data_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace lightloom {

Result<DataLock> DataLock::take(const std::filesystem::path& directory) {
    const std::string path = (directory / "lock").string();
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (descriptor < 0) return failed_precondition(path + ": " + std::strerror(errno));
    if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
        const int error = errno;
        ::close(descriptor);
        if (error == EWOULDBLOCK)
            return failed_precondition(directory.string() +
                                       " is used by another coordinator; stop that one or give another directory with --data");
        return failed_precondition(path + ": cannot be locked: " + std::strerror(error));
    }
    return DataLock(descriptor);
}

DataLock::~DataLock() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace lightloom
