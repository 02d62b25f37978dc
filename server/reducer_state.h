#pragma once
// The state of a reducer's complete groups as bytes, for checkpoints: a version, all that later groups, decisions and images depend
// on, and the SHA-256 of everything before it. Another build does not read it as something else: the version changes with the
// format.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/film/accumulation.h"
#include "common/film/partial.h"
#include "common/work/job.h"
#include "common/work/service.h"

namespace lightloom {

/// A sample that was dropped, and the unit that it is of.
struct DroppedOfUnit {
    UnitKey unit;
    DroppedSample sample;
};

struct ReducerState {
    uint32_t tile_count = 0;
    double noise_target = 0;
    UnitCounters counters;
    std::vector<DroppedOfUnit> dropped;
    RareLight rare_light;
    std::optional<NoiseReport> noise;
};

/// The sums lie in `complete`; all else is in `state`. Without the digest, see seal_state().
std::string encode_reducer_state(const ReducerState& state, const Accumulation& complete);
/// Appends the digest. Takes half a second for a gigabyte, and so is done without the reducer's lock.
void seal_state(std::string& bytes);
/// Reads both; `complete` is empty and of the job's frame and response. kDataLoss for bytes that were damaged,
/// kFailedPrecondition for those of another version or another frame.
Result<ReducerState> decode_reducer_state(std::string_view bytes, Accumulation& complete);

}  // namespace lightloom
