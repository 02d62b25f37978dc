#pragma once
// TrainingRound: the units of one pass over a job's training set, or a part of it, and the data that came of them. A job has one
// at a time: a probe, a pilot, the set itself. No locks, no clock and no scene, as UnitTable, whose answer "first" decides what
// is added here.

#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "common/transport/training.h"
#include "server/unit_table.h"

namespace lightloom {

class TrainingRound {
  public:
    /// What a unit brought.
    struct Part {
        TrainingData data;
        uint64_t bytes = 0;  ///< As it came.
        double seconds = 0;  ///< That the worker took.
    };

    TrainingRound(UnitKind kind, uint32_t number, const TrainingWork& work, std::optional<uint64_t> shuffle_seed);

    UnitKind kind() const { return kind_; }
    /// Of the algorithm's LearningPlan.
    uint32_t number() const { return number_; }
    UnitKey key(uint32_t unit) const { return {unit, 0, kind_, number_}; }
    const TrainingWork& work() const { return work_; }
    UnitTable& units() { return units_; }
    const UnitTable& units() const { return units_; }

    bool complete() const { return units_.done_count() == parts_.size(); }
    /// Of the whole set, those of earlier rounds included.
    uint64_t samples_done() const;
    /// The data of a unit of which the table has said that they are the first.
    void add(uint32_t unit, Part part);
    uint64_t bytes() const { return bytes_; }
    /// What bytes() will be in the end, about: units differ little in size. Needs a part.
    double projected_bytes() const;
    /// That workers took for the parts, together.
    double traced_seconds() const { return traced_seconds_; }

    /// Hands all parts over, so that they can be looked at without the lock under which the round is. Needs complete().
    std::vector<Part> take();
    /// They come back because some are refused, see refuse().
    void put_back(std::vector<Part> parts) { parts_ = std::move(parts); }
    /// The part is worthless after all: leases its unit again.
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

/// One set of all parts, in the order of their units, whatever the order in which they came. kCancelled when asked to stop.
Result<TrainingData> join(std::vector<TrainingRound::Part> parts, std::stop_token stop);

/// Light sub-paths with which a unit measures Q. The spec is complete and valid.
uint64_t energy_paths(const JobSpec& spec, const TrainingWork& work);

/// Bytes above any that serialized data of the unit can have.
uint64_t largest_training_payload(const JobSpec& spec, const TrainingWork& work);

}  // namespace lightloom
