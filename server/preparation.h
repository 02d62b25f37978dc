#pragma once
// Preparation: what a job knows before it can render, and the time that it has taken for that. Like Job it knows no locks and no
// clock.

#include <memory>
#include <optional>
#include <string>

#include "server/scene_facts.h"
#include "server/time_point.h"
#include "server/training_round.h"

namespace lightloom {

struct Preparation {
    PreparePhase phase = PreparePhase::kReadingScene;
    SceneFacts facts;                                ///< From the reading of the scene until the units are planned.
    std::optional<TrainingRound> round;              ///< For a job that makes tables.
    AssetReference guide;                            ///< Tables that the training units read; empty for first rounds and probes.
    std::shared_ptr<const std::string> guide_bytes;  ///< The bytes of the guide, in case the disk loses them.
    bool capped_by_time_limit = false;
    Digest table_key;          ///< Key of the tables that the job needs.
    bool scene_built = false;  ///< Whether the coordinator has built the scene that learning needs.
    bool may_wait = true;      ///< Whether the job may wait for another job's tables: not after damage.
    Digest tables_file;        ///< Digest of the tables that the job will refer to, from before they are stored; zero before.
    TablesInfo handed_over;    ///< Tables of another job, for one that waited for them; without an asset if there are none.
    /// Whether the rounds of the training set follow from the spec, so that their results are worth keeping. Those of a set that
    /// grows by measured time do not.
    bool rounds_are_fixed = true;
    TimePoint training_begin;  ///< When the first training unit was leased; unset before.
    TimePoint round_begin;     ///< The same for the open round.
    /// Since when, without a break, workers trace for the job or it learns, the first worker's scene being there; unset while it
    /// waits.
    TimePoint work_begin;
    double learning_seconds = 0;  ///< What such times before took together: counts towards the time limit.
    struct Learning {
        TimePoint begin;   ///< Begin of the phase kLearning.
        double share = 0;  ///< Share of the phase that is done, approximately.
        TimePoint heard;   ///< When `share` was reported.
        std::optional<double> seconds_left(TimePoint now) const;
    } learning;

    /// Time that counts towards the limit.
    double seconds_taken(TimePoint now) const;
    /// Ends the time since `work_begin`, which counts from now on as taken.
    void stop_clock(TimePoint now);
    /// Starts it where it does not run.
    void start_clock(TimePoint now) {
        if (work_begin == TimePoint()) work_begin = now;
    }
    /// Whether the open round waits, for workers, which other jobs may have, or for the scene that learning needs.
    bool waits() const;
    /// Phase, progress and time left, of a job that is in kPreparing if `open`.
    void tell(TimePoint now, bool open, JobInfo* info) const;
};

}  // namespace lightloom
