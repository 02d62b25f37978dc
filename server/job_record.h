#pragma once
// JobRecord: all that the coordinator knows of a job. The coordinator changes its fields, under the coordinator's mutex
// unless a field says otherwise; the functions here need the record alone.

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/reducer.h"
#include "server/scene_facts.h"
#include "server/time_point.h"
#include "server/training_round.h"
#include "server/unit_table.h"

namespace lightloom {

struct JobRecord {
    std::string id, request_id;
    JobSpec submitted;  ///< As submitted, to recognise a repeated submission.
    JobSpec spec;       ///< Canonical, completed from the scene.
    JobLabel label;
    std::string scene;  ///< Path of the scene file in its file list.
    JobState state = JobState::kPreparing;
    std::string message;
    uint64_t revision = 1;
    TimePoint created, prepared, first_render, finishing, ended;
    bool rendering = false;          ///< Whether first_render is set.
    bool closed = false;             ///< Whether the time limit has passed or the noise target is reached.
    std::string created_at;          ///< UTC, for the manifest only.
    std::vector<ImageLayer> layers;  ///< First-hit layers, until the image is written.
    std::optional<UnitTable> units;  ///< Until the job ends; after that `ended_units` holds the counts.
    struct UnitCounts {
        uint64_t total = 0, done = 0;
    } ended_units;
    std::shared_ptr<Reducer> reducer;  ///< It has its own lock and is used without ours.
    uint32_t merged_groups = 0;        ///< Complete groups merged so far.
    uint64_t merged_iterations = 0;    ///< Iterations of these groups.
    std::set<uint32_t> workers;        ///< Indices of the workers whose units were merged.
    /// Work of all units that arrived; in the end, of those in the image. The same holds for `dropped`.
    UnitCounters counters;
    uint64_t dropped = 0;
    RareLightReport rare_light_report;  ///< About the finished image.
    std::optional<NoiseReport> noise;   ///< About the groups merged at its time, in the end about the finished image.
    uint64_t duplicates_same = 0, duplicates_different = 0, expired_leases = 0, rejected = 0;
    Digest image_digest;
    uint64_t image_size = 0;
    std::filesystem::path directory;
    PreparePhase phase = PreparePhase::kReadingScene;
    SceneFacts facts;                                ///< From the reading of the scene until the units are planned.
    std::optional<TrainingRound> round;              ///< In kPreparing, for a job that makes tables.
    AssetReference guide;                            ///< Tables that the training units read; empty for first rounds and probes.
    std::shared_ptr<const std::string> guide_bytes;  ///< The bytes of the guide, in case the disk loses them.
    bool capped_by_time_limit = false;
    Digest table_key;                  ///< Key of the tables that the job needs; set before `makes_tables` or `maker`.
    bool scene_built = false;          ///< Whether the coordinator has built the scene that learning needs.
    bool set_grows = false;            ///< Whether nobody knows yet which tables the job will make.
    bool makes_tables = false;         ///< Whether the job probes, traces and learns itself.
    bool may_wait = true;              ///< Whether it may wait for another job's tables: not after damage.
    std::shared_ptr<JobRecord> maker;  ///< The job that makes the same tables; this job waits for it.
    TimePoint training_begin;          ///< When the first training unit was leased; unset before.
    /// Since when, without a break, workers trace for the job or it learns, the first worker's scene being there; unset while it
    /// waits.
    TimePoint work_begin;
    double learning_seconds = 0;  ///< What such times before took together: counts towards the time limit.
    TimePoint round_begin;        ///< The same for the open round.
    struct Learning {
        TimePoint begin;   ///< Begin of the phase kLearning.
        double share = 0;  ///< Share of the phase that is done, approximately.
        TimePoint heard;   ///< When `share` was reported.
        std::optional<double> seconds_left(TimePoint now) const;
    } learning;
    TablesInfo tables;
    Digest tables_asset;  ///< Digest of the tables that the job refers to or will refer to; zero before.

    std::jthread prepare_task, train_task, finish_task;
    /// How many of these run. A job is forgotten only when none does, so that nobody joins a task under the mutex.
    int running_tasks = 0;

    JobInfo info(TimePoint now) const;
    /// What is left of the time limit; only for a job that has one. Neither reading the scene nor waiting, for workers or for
    /// the tables of another job, takes any of it.
    double seconds_left(TimePoint now) const;
    /// Ends the time since `work_begin`, which counts from now on as taken.
    void stop_clock(TimePoint now);
    /// Whether the open round waits, for workers, which other jobs may have, or for the scene that learning needs.
    bool waits() const;
    /// The units that can be leased now, or null.
    UnitTable* open_units();
    /// The same if the unit is of their kind and round, otherwise null: a late result of one round does not belong to
    /// the next.
    UnitTable* open_units(const UnitKey& unit);
};

/// True for a job that neither samples nor time bound: how many units it has turns out while it runs.
inline bool only_noise_bounds(const JobSpec& spec) { return spec.samples_per_pixel == 0 && spec.time_limit_seconds == 0; }

/// The job itself, or the job at the end of the chain of those that it waits for. There is no circle: a job that waits
/// makes no tables, and only jobs that make tables are waited for.
const std::shared_ptr<JobRecord>& maker_of_last_resort(const std::shared_ptr<JobRecord>& job);

/// A unit that failed on this many workers fails its job, because the unit is the cause and not the workers.
inline constexpr int kMaxFailedWorkers = 3;
/// So does a unit that failed this often, where there are fewer workers.
inline constexpr int kMaxUnitFailures = 10;
/// A unit over which this many workers went silent fails its job: it seems to crash them. The number is larger than for
/// failures, because hosts also go down for other reasons.
inline constexpr size_t kMaxLostWorkers = 5;

}  // namespace lightloom
