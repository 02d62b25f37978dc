#include "common/core/usable_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

namespace lightloom {

namespace fs = std::filesystem;

namespace {

constexpr uint64_t kNone = std::numeric_limits<uint64_t>::max();

/// The number in the file; kNone if it holds another word ("max") or is not there.
uint64_t limit_in(const fs::path& file) {
    std::ifstream in(file);
    uint64_t bytes = 0;
    return in >> bytes ? bytes : kNone;
}

/// Of the group and those above it: each of them holds. In a container, groups outside are not mounted and their files are missing.
uint64_t least_limit(const fs::path& mount, std::string_view group, const char* file) {
    uint64_t least = limit_in(mount / file);
    for (fs::path at = fs::path(group).relative_path(); !at.empty(); at = at.parent_path())
        least = std::min(least, limit_in(mount / at / file));
    return least;
}

}  // namespace

uint64_t control_group_limit(std::string_view membership, const fs::path& mount) {
    uint64_t least = kNone;
    while (!membership.empty()) {
        const std::string_view line = membership.substr(0, membership.find('\n'));  // number:controllers:group
        membership.remove_prefix(std::min(membership.size(), line.size() + 1));
        const size_t first = line.find(':'), second = first == line.npos ? line.npos : line.find(':', first + 1);
        if (second == line.npos) continue;
        const std::string_view controllers = line.substr(first + 1, second - first - 1), group = line.substr(second + 1);
        if (controllers.empty()) least = std::min(least, least_limit(mount, group, "memory.max"));
        if (controllers == "memory") least = std::min(least, least_limit(mount / "memory", group, "memory.limit_in_bytes"));
    }
    return least;
}

uint64_t usable_memory() {
    uint64_t bytes = uint64_t(std::max(0L, ::sysconf(_SC_PHYS_PAGES))) * uint64_t(std::max(0L, ::sysconf(_SC_PAGESIZE)));
    rlimit limit{};
    if (::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) bytes = std::min<uint64_t>(bytes, limit.rlim_cur);
    std::ifstream in("/proc/self/cgroup");
    const std::string membership{std::istreambuf_iterator<char>(in), {}};
    return std::min(bytes, control_group_limit(membership, "/sys/fs/cgroup"));
}

}  // namespace lightloom
