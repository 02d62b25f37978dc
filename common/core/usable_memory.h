#pragma once
// Memory that this process may use: what the machine has, or less where a limit is set.

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace lightloom {

/// Bytes: the least of the machine's memory, RLIMIT_AS and the limits of the control groups that the process is in (containers,
/// systemd's MemoryMax).
uint64_t usable_memory();

/// The least memory limit of a control group and those above it, bytes; UINT64_MAX if there is none. `membership` is the text of
/// /proc/PID/cgroup, `mount` where control groups are mounted, version 1 or 2.
uint64_t control_group_limit(std::string_view membership, const std::filesystem::path& mount);

}  // namespace lightloom
