#include "common/core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "common/core/crash_point.h"

namespace lightloom {

namespace {

Status failure(const std::string& path, const char* what, int error) {
    const std::string line = path + ": " + what + ": " + std::generic_category().message(error);
    if (error == ENOENT) return not_found(line);
    if (error == ENOSPC || error == EDQUOT) return {StatusCode::kResourceExhausted, line};
    return invalid_argument(line);
}

}  // namespace

Status write_file_atomically(const std::string& path, std::string_view bytes) {
    static std::atomic<uint64_t> counter{0};
    // A symbolic link stays and the file that it points to is replaced; a pipe or a device is written to directly.
    std::error_code none;
    const std::filesystem::path resolved = std::filesystem::canonical(path, none);
    const std::string target = none ? path : resolved.string();
    struct stat info {};
    const bool stream = stat(target.c_str(), &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
    const std::string temporary = stream ? target : target + ".tmp-" + std::to_string(getpid()) + "-" + std::to_string(counter++);
    const int file = open(temporary.c_str(), stream ? O_WRONLY | O_CLOEXEC : O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0) return failure(path, "cannot be written", errno);
    int error = 0;
    while (!bytes.empty() && error == 0) {
        const ssize_t written = write(file, bytes.data(), bytes.size());
        if (written >= 0) {
            bytes.remove_prefix(size_t(written));
        } else if (errno != EINTR) {
            error = errno;
        }
    }
    if (error == 0 && fsync(file) != 0 && errno != EINVAL) error = errno;  // EINVAL: such a file cannot be flushed.
    if (close(file) != 0 && error == 0) error = errno;
    if (!stream && error == 0) crash_point("file.before-rename");
    if (!stream && error == 0 && std::rename(temporary.c_str(), target.c_str()) != 0) error = errno;
    if (!stream && error == 0) crash_point("file.after-rename");
    if (!stream && error == 0) {
        const std::filesystem::path folder = std::filesystem::path(target).parent_path();
        if (const Status flushed = flush_folder(folder.empty() ? "." : folder.string()); !flushed.ok()) return flushed;
    }
    if (error != 0) {
        if (!stream) unlink(temporary.c_str());
        return failure(path, "cannot be written", error);
    }
    return Status::ok_status();
}

Status flush_folder(const std::string& path) {
    const int folder = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return errno == EACCES ? Status() : failure(path, "cannot be opened", errno);  // one may write without reading
    const int error = fsync(folder) != 0 && errno != EINVAL ? errno : 0;
    close(folder);
    return error == 0 ? Status() : failure(path, "cannot be flushed", error);
}

Result<std::string> read_file(const std::string& path) {
    const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return failure(path, "cannot be read", errno);
    std::string bytes;
    struct stat info {};
    int error = fstat(file, &info) != 0 ? errno : 0;
    if (error == 0 && S_ISDIR(info.st_mode)) error = EISDIR;
    if (error == 0) bytes.reserve(size_t(info.st_size));
    char buffer[1 << 16];
    while (error == 0) {
        const ssize_t got = read(file, buffer, sizeof buffer);
        if (got > 0) {
            bytes.append(buffer, size_t(got));
        } else if (got == 0) {
            break;
        } else if (errno != EINTR) {
            error = errno;
        }
    }
    close(file);
    if (error != 0) return failure(path, "cannot be read", error);
    return bytes;
}

}  // namespace lightloom
