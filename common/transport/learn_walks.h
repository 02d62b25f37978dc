#pragma once
// What training tells the walks of an algorithm: how light sub-paths leave the lights, and where camera sub-paths still have
// something to gain. These are the first of an algorithm's tables, on which the others depend, and all that some have.

#include <optional>

#include "common/tables/emission_part.h"
#include "common/tables/gain_part.h"
#include "common/transport/learning.h"

namespace lightloom {

/// The parts of a round's tables that walks read, as far as the settings ask for them.
class WalkLessons {
  public:
    /// Reads the data's visits: before TrainingControl::data_read.
    explicit WalkLessons(const LearnRequest& request);

    /// Tells the learning of subspaces how light leaves the lights; it must end before this object does.
    void tell(TrainingOptions* options) const {
        if (emission_.learned()) options->traced = &*traced_, options->rendered = &*rendered_;
    }
    /// Sets those parts that the algorithm has. The report gets the time that they took and a note of what was asked for
    /// but could not be learned.
    void move_to(Tables* tables);

  private:
    const LearnRequest& request_;
    EmissionData emission_;
    GainData gain_;
    /// The emitters as they were where the round was traced, and as the render will have them; only if something was learned.
    std::optional<EmitterSet> traced_, rendered_;
    double seconds_ = 0;
};

/// Learning of algorithms that learn nothing else: emission, gains, or both; only where the settings ask for it.
extern const LearningInfo kEmissionLearning, kGainLearning, kWalkLearning;

}  // namespace lightloom
