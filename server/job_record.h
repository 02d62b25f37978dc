#pragma once
// JobRecord: all that the coordinator knows of a job. Its fields are the coordinator's to change, under the coordinator's mutex
// unless they say otherwise; what can be told from them alone is told here.

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
    JobSpec submitted;  ///< As it came, to recognise a repeated submission.
    JobSpec spec;       ///< Canonical, completed from the scene.
    JobState state = JobState::kPreparing;
    std::string message;
    uint64_t revision = 1;
    TimePoint created, prepared, first_render, finishing, ended;
    bool rendering = false;          ///< first_render is set.
    bool closed = false;             ///< The time limit has passed.
    std::string created_at;          ///< UTC, for the manifest only.
    std::vector<ImageLayer> layers;  ///< First-hit layers, until the image is written.
    std::optional<UnitTable> units;  ///< Until the job ends; then `ended_units` is left of it.
    struct UnitCounts {
        uint64_t total = 0, done = 0;
    } ended_units;
    double unit_light_paths = 0;            ///< Of a unit of the largest groups, about.
    std::optional<double> splats_per_path;  ///< The most that a partial had so far.
    std::shared_ptr<Reducer> reducer;       ///< Has its own lock; used without ours.
    uint32_t merged_groups = 0;             ///< Complete groups merged so far.
    uint64_t merged_iterations = 0;         ///< Iterations of these.
    std::set<uint32_t> workers;             ///< Indices of those whose units were merged.
    UnitCounters counters;  ///< Of all units that arrived; in the end, of those that are in the image. So is `dropped`.
    uint64_t dropped = 0;
    RareLight rare_light;               ///< From the first unit, once that is merged.
    RareLightReport rare_light_report;  ///< Of the finished image.
    uint64_t duplicates_same = 0, duplicates_different = 0, expired_leases = 0, rejected = 0;
    Digest image_digest;
    uint64_t image_size = 0;
    std::filesystem::path directory;
    PreparePhase phase = PreparePhase::kReadingScene;
    SceneFacts facts;                                ///< From the reading of the scene until the units are planned.
    std::optional<TrainingRound> round;              ///< In kPreparing, of a job that makes tables.
    AssetReference guide;                            ///< Tables that the training units read; empty for first rounds and probes.
    std::shared_ptr<const std::string> guide_bytes;  ///< Of these, should the disk lose them.
    bool capped_by_time_limit = false;
    Digest table_key;                  ///< Of the tables that the job needs; set before `makes_tables` or `maker`.
    bool makes_tables = false;         ///< It probes, traces and learns itself.
    bool may_wait = true;              ///< For another job's tables: not again for those that were taken over and were damaged.
    std::shared_ptr<JobRecord> maker;  ///< Makes the same tables; this job waits for them.
    TimePoint training_begin;          ///< The first training unit was leased; unset before.
    TimePoint round_begin;             ///< The same of the open round.
    struct Learning {
        TimePoint begin;   ///< Of the phase kLearning.
        double share = 0;  ///< Of that phase that is done, about.
        TimePoint heard;   ///< When the share was that.
        std::optional<double> seconds_left(TimePoint now) const;
    } learning;
    TablesInfo tables;
    Digest tables_asset;  ///< Of the tables that the job names, or is about to; zero before.

    std::jthread prepare_task, train_task, finish_task;
    int running_tasks = 0;  ///< Of these. A job is forgotten only without any, so that nobody waits for one under the mutex.

    JobInfo info(TimePoint now) const;
    /// The units that can be leased now, or null.
    UnitTable* open_units();
    /// The same if the unit is of their kind and round, otherwise null: a late result of one round is none of the next.
    UnitTable* open_units(const UnitKey& unit);
};

/// The job itself, or who makes the tables that it, and those that it waits for, wait for. Jobs never wait in a circle: who waits
/// makes no tables, and only makers are waited for.
const std::shared_ptr<JobRecord>& maker_of_last_resort(const std::shared_ptr<JobRecord>& job);

/// Behind the word "unit", for people.
inline std::string unit_name(const UnitKey& key) {
    return key.kind == UnitKind::kRender ? std::to_string(key.group) + "/" + std::to_string(key.tile)
                                         : "of training " + std::to_string(key.round) + "/" + std::to_string(key.group);
}

/// A unit that failed on this many workers fails its job: it is the unit, not the workers.
inline constexpr int kMaxFailedWorkers = 3;
/// The same for a unit that failed this often where there are fewer workers.
inline constexpr int kMaxUnitFailures = 10;
/// A unit over which this many workers went silent fails its job: it seems to crash them. More than for failures, because hosts
/// also go down for reasons of their own.
inline constexpr size_t kMaxLostWorkers = 5;

}  // namespace lightloom
