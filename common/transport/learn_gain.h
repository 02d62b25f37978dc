#pragma once
// The gain table of roulette=learned as the algorithms of the catalog share it.

#include "common/tables/gain_part.h"
#include "common/transport/learning.h"

namespace lightloom {

/// Learns gains from a round; nothing (GainData::learned()) if the settings do not ask for it, or no sub-path found light. Reads
/// the data's visits: before TrainingControl::data_read.
GainData learn_gain(const LearnRequest& request);

/// Learning of algorithms that learn nothing but gains, and of those that learn emission and gains: only where the settings ask
/// for it.
extern const LearningInfo kGainLearning, kEmissionAndGainLearning;

}  // namespace lightloom
