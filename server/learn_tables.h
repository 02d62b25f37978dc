#pragma once
// Learning the tables of one job: chooses the size of the training set where a time limit asks for it, and learns in the
// rounds of the algorithm's plan. Who traces the rounds, and what else becomes of the job, is behind TracingPort: there are no
// locks, no workers and no other jobs here.

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>

#include "common/tables/train.h"
#include "common/transport/training.h"
#include "common/work/service.h"
#include "server/time_point.h"
#include "server/worker_registry.h"

namespace lightloom {

/// A round of training units that is complete.
struct TracedRound {
    UnitKind kind = UnitKind::kTraining;
    uint32_t round = 0;  ///< Of the algorithm's LearningPlan.
    TrainingWork work;
    TrainingData data;          ///< Joined in the order of the units.
    double worker_seconds = 0;  ///< That workers took for the units, together.
    double seconds = 0;         ///< On the clock, from the round's first lease until its data were joined.
};

/// The training set that a time limit has room for.
struct AffordableSet {
    JobSpec spec;  ///< Canonical, with the size of the set.
    uint64_t samples = 0, wanted = 0;
    uint64_t probe_samples = 0;
    double probe_traced_seconds = 0, probe_learned_seconds = 0;
};

/// Has training units traced. An error of any of these ends learning, and is what comes of it.
class TracingPort {
  public:
    virtual ~TracingPort() = default;
    /// Waits for the round that is open: a probe or one of the plan.
    virtual Result<TracedRound> collect() = 0;
    /// Who could trace another one.
    virtual WorkerRegistry::Crew crew() const = 0;
    /// After a probe. True: the first round of that set is open. False: nothing is left to learn, because the set's tables exist
    /// or another job makes them.
    virtual Result<bool> settle(const AffordableSet& set) = 0;
    /// What was collected of a round is being learned from.
    virtual void learning_begins() = 0;
    /// So much of the time for that has passed, about.
    virtual void learning_goes_on(double share) = 0;
    /// Opens another round, having published the tables that guide it, if there are any.
    virtual Status open_round(uint32_t round, const Tables& guide, const TrainingWork& work) = 0;
};

struct LearnedTables {
    Tables tables;
    JobSpec spec;     ///< Whose tables they are.
    TablesInfo info;  ///< What learning knows of them; nothing of assets, caches and whether a limit made the set smaller.
};

/// The tables of a job whose first round is open; nothing after settle() said so. kCancelled within about a second of a stop
/// request while it trains.
Result<std::optional<LearnedTables>> learn_tables(JobSpec spec, const EmitterSet& emitters, TracingPort& port,
                                                  const std::function<TimePoint()>& clock, std::stop_token stop);

}  // namespace lightloom
