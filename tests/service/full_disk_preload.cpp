// A disk that is full for a while, for a program that is started with LD_PRELOAD naming this library:
//
//   LIGHTLOOM_FULL_DISK=K:SECONDS:DIRECTORY
//
// the K-th write to a file below DIRECTORY fails with ENOSPC, and so do those of the SECONDS that follow. A directory or a link
// that is made counts as a write. All of the process is concerned, the database as well. A line on standard error says when it
// begins.

#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>

namespace {

using Clock = std::chrono::steady_clock;

struct Plan {
    long write = 0;
    double seconds = 0;
    const char* directory = nullptr;
};

Plan read_plan() {
    Plan plan;
    const char* const text = std::getenv("LIGHTLOOM_FULL_DISK");
    int at = 0;
    if (text && std::sscanf(text, "%ld:%lf:%n", &plan.write, &plan.seconds, &at) == 2) plan.directory = text + at;
    return plan;
}

bool below(const char* path, const char* directory) { return std::strncmp(path, directory, std::strlen(directory)) == 0; }

bool is_full() {
    static const Plan plan = read_plan();
    static std::atomic<long> writes{0};
    static std::atomic<int64_t> until{0};
    const long number = ++writes;
    const auto now = Clock::now().time_since_epoch();
    if (number == plan.write) {
        until = (now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(plan.seconds))).count();
        constexpr char kLine[] = "the disk is full for a while\n";
        (void)!::syscall(SYS_write, STDERR_FILENO, kLine, sizeof kLine - 1);
    }
    return now.count() < until;
}

/// Whether a write to the file fails.
bool fails(int file) {
    static const Plan plan = read_plan();
    if (!plan.directory) return false;
    struct stat info {};
    if (::fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) return false;
    char link[64], path[4096];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    const ssize_t size = ::readlink(link, path, sizeof path - 1);
    if (size <= 0) return false;
    path[size] = '\0';
    if (!below(path, plan.directory) || !is_full()) return false;
    errno = ENOSPC;
    return true;
}

/// Whether a name can not be made.
bool fails(const char* path) {
    static const Plan plan = read_plan();
    if (!plan.directory || !below(path, plan.directory) || !is_full()) return false;
    errno = ENOSPC;
    return true;
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* bytes, size_t size) { return fails(file) ? -1 : ::syscall(SYS_write, file, bytes, size); }

ssize_t writev(int file, const iovec* parts, int count) { return fails(file) ? -1 : ::syscall(SYS_writev, file, parts, count); }

ssize_t pwrite(int file, const void* bytes, size_t size, off_t offset) {
    return fails(file) ? -1 : ::syscall(SYS_pwrite64, file, bytes, size, offset);
}

ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t offset) {
    return fails(file) ? -1 : ::syscall(SYS_pwrite64, file, bytes, size, offset);
}

ssize_t pwritev(int file, const iovec* parts, int count, off_t offset) {
    return fails(file) ? -1 : ::syscall(SYS_pwritev, file, parts, count, offset, 0);
}

ssize_t pwritev64(int file, const iovec* parts, int count, off64_t offset) {
    return fails(file) ? -1 : ::syscall(SYS_pwritev, file, parts, count, offset, 0);
}

int mkdir(const char* path, mode_t mode) noexcept { return fails(path) ? -1 : int(::syscall(SYS_mkdir, path, mode)); }

int link(const char* from, const char* to) noexcept { return fails(to) ? -1 : int(::syscall(SYS_link, from, to)); }

ssize_t sendfile(int to, int from, off_t* offset, size_t size) noexcept {
    return fails(to) ? -1 : ::syscall(SYS_sendfile, to, from, offset, size);
}

char* mkdtemp(char* pattern) noexcept {
    if (fails(pattern)) return nullptr;
    for (unsigned number = unsigned(::getpid());; ++number) {
        std::snprintf(pattern + std::strlen(pattern) - 6, 7, "%06u", number % 1000000);
        if (::syscall(SYS_mkdir, pattern, 0700) == 0) return pattern;
        if (errno != EEXIST) return nullptr;
    }
}

}  // extern "C"
