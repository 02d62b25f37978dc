#pragma once
// Learned emission as the algorithms of the catalog share it: the first of an algorithm's tables, on which the others
// depend.

#include <optional>

#include "common/tables/emission_part.h"
#include "common/transport/learning.h"

namespace lightloom {

/// How light leaves the lights, before and after a round of learning.
struct EmissionLesson {
    EmissionData data;  ///< What this round has learned.
    /// The emitters as they were where the round was traced, and as the render will have them; only if something was learned.
    std::optional<EmitterSet> traced, rendered;

    /// Tells the learning of subspaces, which must end before this object does.
    void tell(TrainingOptions* options) const {
        if (data.learned()) options->traced = &*traced, options->rendered = &*rendered;
    }
};

/// Learns emission from a round; nothing (EmissionData::learned()) if the settings do not ask for it.
EmissionLesson learn_emission(const LearnRequest& request);

/// Learning of algorithms that learn nothing else: only where `emission` asks for it, in two rounds.
extern const LearningInfo kEmissionLearning;

}  // namespace lightloom
