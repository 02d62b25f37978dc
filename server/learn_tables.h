#pragma once
// Learns the tables of one job, in the rounds of the algorithm's plan. Where there is a time limit it also chooses the
// size of the training set: a probe tells what is within reach, and a set that grows is complete as soon as more of it
// would cost the job more than it gives (training_budget.h). TracingPort hides who traces the rounds and how the job goes on: this
// code knows no locks, no workers and no other jobs.

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
    uint32_t round = 0;  ///< Index into the rounds of the algorithm's LearningPlan.
    TrainingWork work;
    TrainingData data;          ///< Joined in the order of the units, behind those of earlier rounds.
    double worker_seconds = 0;  ///< Time that workers took for the units, added up.
    double seconds = 0;         ///< Elapsed time from the round's first lease until its data were joined.
};

/// The training set that a time limit has room for.
struct AffordableSet {
    JobSpec spec;  ///< Canonical, with the size of the set; with that of the largest one if the set grows.
    uint64_t samples = 0, wanted = 0;
    bool grows = false;  ///< Rounds will tell the size; `samples` is a guess.
    uint64_t probe_samples = 0;
    double probe_traced_seconds = 0, probe_learned_seconds = 0;
};

/// Lets workers trace training units. An error of any function ends learning and is its result.
class TracingPort {
  public:
    virtual ~TracingPort() = default;
    /// Waits for the open round, which is a probe or one of the plan, and appends its data to `earlier`.
    virtual Result<TracedRound> collect(TrainingData earlier) = 0;
    /// What is left of the job's time limit.
    virtual double seconds_left() const = 0;
    /// The workers that could trace another round.
    virtual WorkerRegistry::Crew crew() const = 0;
    /// Called after a probe. True if the first round of that set is open; false if there is nothing left to learn,
    /// because the set's tables exist or another job makes them.
    virtual Result<bool> settle(const AffordableSet& set) = 0;
    /// Called when learning from a collected round begins.
    virtual void learning_begins() = 0;
    /// Called with the approximate share of the learning time that has passed.
    virtual void learning_goes_on(double share) = 0;
    /// Publishes the tables that guide the next round, if there are any, and opens the round.
    virtual Status open_round(uint32_t round, const Tables& guide, const TrainingWork& work) = 0;
};

struct LearnedTables {
    Tables tables;
    JobSpec spec;     ///< The spec that the tables belong to.
    TablesInfo info;  ///< What learning knows of them, without assets and caches.
};

/// Learns the tables of a job whose first round is open; nothing if settle() returned false. kCancelled within about a
/// second of a stop request while it trains.
Result<std::optional<LearnedTables>> learn_tables(JobSpec spec, const EmitterSet& emitters, TracingPort& port,
                                                  const std::function<TimePoint()>& clock, std::stop_token stop);

}  // namespace lightloom
