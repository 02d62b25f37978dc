#pragma once
// TrainingRound: the units of one pass over a job's training set, or a part of it, and their data. A job has one round
// at a time: a probe, a pilot, the set itself. Like UnitTable, whose answer "first" decides what is added here, it has
// no locks, no clock and no scene.

#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "common/transport/training.h"
#include "server/unit_table.h"

namespace lightloom {

class TrainingRound {
  public:
    /// The data of a unit.
    struct Part {
        TrainingData data;
        uint64_t bytes = 0;  ///< Size as received.
        double seconds = 0;  ///< Time that the worker took.
    };

    TrainingRound(UnitKind kind, uint32_t number, const TrainingWork& work, std::optional<uint64_t> shuffle_seed);

    UnitKind kind() const { return kind_; }
    /// Index into the rounds of the algorithm's LearningPlan.
    uint32_t number() const { return number_; }
    UnitKey key(uint32_t unit) const { return {unit, 0, kind_, number_}; }
    const TrainingWork& work() const { return work_; }
    UnitTable& units() { return units_; }
    const UnitTable& units() const { return units_; }

    bool complete() const { return units_.done_count() == parts_.size(); }
    /// Samples of the whole set that are done, including those of earlier rounds.
    uint64_t samples_done() const;
    /// Adds the data of a unit for which the table has answered "first".
    void add(uint32_t unit, Part part);
    uint64_t bytes() const { return bytes_; }
    /// Estimate of bytes() when the round is complete: units differ little in size. Needs at least one part.
    double projected_bytes() const;
    /// Time that workers took for the parts, added up.
    double traced_seconds() const { return traced_seconds_; }

    /// Hands over all parts, so that they can be examined without the lock that guards the round. Needs complete().
    std::vector<Part> take();
    /// Takes the parts back because some are refused, see refuse().
    void put_back(std::vector<Part> parts) { parts_ = std::move(parts); }
    /// The part turned out to be invalid: leases its unit again.
    UnitTable::Failures refuse(uint32_t unit);

  private:
    UnitKind kind_;
    uint32_t number_;
    TrainingWork work_;
    UnitTable units_;
    std::vector<Part> parts_;  // by unit
    uint64_t bytes_ = 0;
    double traced_seconds_ = 0;
};

/// Appends all parts to `all`, in the order of their units, whatever the order in which they came. kCancelled after a
/// stop request.
Result<TrainingData> join(TrainingData all, std::vector<TrainingRound::Part> parts, std::stop_token stop);

/// Number of light sub-paths with which a unit measures Q. The spec is complete and valid.
uint64_t energy_paths(const JobSpec& spec, const TrainingWork& work);

/// An upper bound of the size of a unit's serialized data, in bytes.
uint64_t largest_training_payload(const JobSpec& spec, const TrainingWork& work);
/// kDataLoss unless the data can be those of this unit, and be joined with those of the others.
Status check_unit_data(const TrainingData& data, const JobSpec& spec, const TrainingWork& work);

}  // namespace lightloom
