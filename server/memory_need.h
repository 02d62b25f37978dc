#pragma once
// What memory a job will take of the coordinator, estimated before it is accepted to render: the system may hand out memory that it
// does not have, and end the process that uses it hours later.

#include <cstdint>
#include <string>

#include "common/core/result.h"
#include "common/work/job.h"

namespace lightloom {

/// Bytes. Upper bounds but for training data, of which nobody knows beforehand how long paths are.
struct MemoryNeed {
    uint64_t image = 0;     ///< Sums of the complete groups.
    uint64_t groups = 0;    ///< Sums of groups under way: one at least, and those that wait for earlier ones.
    uint64_t layers = 0;    ///< First-hit layers.
    uint64_t training = 0;  ///< Training data, which are gone when the image begins to be made.
    uint64_t writing = 0;   ///< The image as it is developed and encoded at the end.

    /// The most that is needed at a time. Learning comes before rendering, and writing when no groups are under way any more.
    uint64_t peak() const;
};

/// Of a job whose frame and algorithm are those that it is rendered with. `waiting_bytes` and `training_bytes` are the
/// coordinator's limits for a job's waiting groups and training data.
MemoryNeed memory_need(const JobSpec& spec, uint64_t waiting_bytes, uint64_t training_bytes);

/// Groups that may be under way at a time: the one that is completed next, and those later ones whose sums fit in `waiting_bytes`.
uint32_t most_open_groups(const JobSpec& spec, uint64_t waiting_bytes);

/// "1.9 GB (image 0.5, groups under way 0.7, writing it 0.7)": parts that are 0 are left out.
std::string memory_text(const MemoryNeed& need);

/// Whether a job can be admitted: kResourceExhausted with what it needs, what there is and what to do about it, unless it fits into
/// `host_bytes` without what other jobs need already. `host_bytes` 0: nobody knows, and every job fits.
Status check_memory(const JobSpec& spec, const MemoryNeed& need, uint64_t host_bytes, uint64_t other_jobs_bytes);

}  // namespace lightloom
