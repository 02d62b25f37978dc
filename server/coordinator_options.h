#pragma once
// What a coordinator is started with.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "common/work/service.h"
#include "server/scene_facts.h"
#include "server/time_bounds.h"
#include "server/time_point.h"

namespace lightloom {

struct CoordinatorOptions {
    std::filesystem::path directory;  ///< Assets and finished images; made if need be.
    BuildIdentity identity;           ///< A worker must have the same.
    SceneReader read_scene;
    bool scene_files_needed = true;  ///< False where read_scene and the workers have the files by other means.
    bool no_other_workers = false;   ///< All workers are in this process: what it lacks nobody else has, and waiting helps nothing.
    double lease_seconds = 10;
    double heartbeat_seconds = 1;
    std::optional<uint64_t> shuffle_seed;  ///< Lease units in a random order (tests).
    /// Called by any thread at any time.
    std::function<TimePoint()> clock = [] { return std::chrono::steady_clock::now(); };
    /// Called by the ticker with each of its turns, once in two seconds at least.
    std::function<void()> beat;
    /// Memory of the host, into which a frame's sums must fit. 0: as the system reports it.
    int64_t memory_bytes = 0;
    uint64_t waiting_bytes = uint64_t(512) << 20;  ///< Most memory for the sums of groups that wait for earlier ones.
    std::filesystem::path table_cache;             ///< Tables of earlier jobs; empty: none are kept.
    uint64_t table_cache_bytes = uint64_t(4) << 30;
    uint64_t training_bytes = uint64_t(8) << 30;  ///< Most training data of one job: 7e6 samples of a hard interior.
    TimeBounds unit_time;                         ///< After which a unit is taken away from its worker.
    size_t max_jobs = 10000;                      ///< Most jobs that have not ended.
    size_t kept_jobs = 1000;                      ///< Ended jobs that are remembered; the oldest are forgotten, their files stay.
    uint64_t checkpoint_bytes = uint64_t(64) << 20;  ///< At least so many bytes of results come between two checkpoints of a job.
    /// Below this much free space on the disk of `directory` no units are given out.
    uint64_t disk_reserve_bytes = uint64_t(64) << 20;
    /// The ticker sleeps until something is due, but no longer than this: a clock that jumps (tests) wakes nobody.
    double longest_sleep_seconds = 10;
};

}  // namespace lightloom
