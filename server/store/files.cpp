#include "server/store/files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace lightloom {

ssize_t StoreFiles::write(int file, const iovec* parts, int count, off_t offset) { return ::pwritev(file, parts, count, offset); }

int StoreFiles::sync(int file) { return ::fdatasync(file); }

Status StoreFiles::sync_directory(const std::filesystem::path& directory) {
    const int file = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) return file_error(directory, "cannot be opened", errno);
    const int error = ::fsync(file) != 0 ? errno : 0;
    ::close(file);
    return error == 0 ? Status() : file_error(directory, "cannot be flushed to disk", error);
}

StoreFiles& StoreFiles::system() {
    static StoreFiles files;
    return files;
}

bool is_no_room(int error) { return error == ENOSPC || error == EDQUOT || error == EFBIG; }

Status file_error(const std::filesystem::path& path, const std::string& what, int error) {
    const std::string line = path.string() + ": " + what + ": " + std::generic_category().message(error);
    const bool exhausted = is_no_room(error) || error == EMFILE || error == ENFILE || error == ENOMEM;
    return {exhausted ? StatusCode::kResourceExhausted : StatusCode::kInternal, line};
}

Status make_directory(const std::filesystem::path& directory, StoreFiles& files) {
    std::error_code error;
    std::filesystem::create_directories(directory, error);
    if (error) return file_error(directory, "cannot be created", error.value());
    return files.sync_directory(directory.parent_path());
}

}  // namespace lightloom
